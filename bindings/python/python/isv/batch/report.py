"""Reports: how far a plan is, a table with a row for each take, and a page of the worst ones."""

from __future__ import annotations

import csv
import heapq
import html
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .plan import Plan
from .storage import Store
from .tasks import planned_key, shard_name, take_folder

__all__ = ["COLUMNS", "Status", "rows", "status", "write_report"]

COLUMNS: dict[str, type] = {
    "take": str,
    "status": str,
    "error": str,
    "source": str,
    "frames": int,
    "seconds": float,
    "bytes": int,
    "mbps": float,
    "voxel_mm": float,
    "sign": str,
    "quality": float,
    "shards": int,
    "skipped": int,
    "p2s_mean_mm": float,
    "p2s_rms_mm": float,
    "p2s_p99_mm": float,
    "hausdorff_mm": float,
    "normal_error_deg": float,
    "colour_y_psnr_db": float,
    "worst_frame": int,
    "worst_rms_mm": float,
    "encode_cpu_s": float,
    "finish_cpu_s": float,
}
"""Columns of the table, with the type of their values. A value that is not known is empty."""

Row = dict[str, Any]

_GROUP = 1000
"""Rows of the table that are held at a time."""


@dataclass
class Status:
    """How far a plan is.

    Attributes:
        takes: Takes of the plan.
        done: Takes that are finished.
        failed: Takes that cannot be planned, or failed when they were last run.
        shards: Shards of the plan.
        shards_done: Shards that are encoded, of takes that are not finished.
    """

    takes: int = 0
    done: int = 0
    failed: int = 0
    shards: int = 0
    shards_done: int = 0

    @property
    def waiting(self) -> int:
        """Takes that are neither finished nor failed."""
        return self.takes - self.done - self.failed


def status(plan: Plan, output: Store) -> Status:
    """Find out how far a plan is, by the files in its output."""
    found = Status()
    for take in plan.takes():
        found.takes += 1
        shards = take.get("shards", [])
        found.shards += len(shards)
        row = _row(take, output)
        if row["status"] == "done":
            found.done += 1
            continue
        found.failed += row["status"] == "failed"
        names = set(output.names(f"{take_folder(take)}/shards"))
        wanted = (shard_name(take, shard).rsplit("/", 1)[1] for shard in shards)
        found.shards_done += sum(name + ".json" in names for name in wanted)
    return found


def rows(plan: Plan, output: Store) -> Iterator[Row]:
    """The row of each take."""
    for take in plan.takes():
        yield _row(take, output)


def _row(take: Row, output: Store) -> Row:
    base = {"take": take["name"], "source": take["source"]}
    if "error" in take:
        return {**base, "status": "failed", "error": take["error"]}
    failed = output.read_json(f"{take_folder(take)}/error.json")
    if failed is not None:
        return {**base, "status": "failed", "error": failed["error"]}
    row = output.read_json(f"{take_folder(take)}/take.json")
    key = planned_key(take)
    # What another plan has made is not done.
    if row is None or row.get("planned", key) != key:
        return {**base, "status": "waiting"}
    errors = row.get("errors", {})
    frames = errors.get("frames", [])
    worst = frames[0] if frames else {}
    means = {name: value for name, value in errors.items() if COLUMNS.get(name) is float}
    return {
        **row,
        **base,
        **means,
        "worst_frame": worst.get("frame"),
        "worst_rms_mm": worst.get("p2s_rms_mm"),
        "error": errors.get("why_not") and f"not measured: {errors['why_not']}",
    }


def write_report(plan: Plan, output: Store, table: str = "takes.csv", page: int = 100) -> dict[str, int]:
    """Write the table of takes and the page of the worst ones into the output.

    Args:
        plan: The plan.
        output: Folder of the streams.
        table: Name of the table: ``.csv``, or ``.parquet``, which needs PyArrow.
        page: Takes on the page: those that failed, and then those with the largest errors.

    Returns:
        The number of takes by their status.

    Raises:
        ValueError: The name of the table has another ending.
        ImportError: PyArrow is not installed.
    """
    ending = os.path.splitext(table)[1]
    if ending not in (".csv", ".parquet"):
        raise ValueError(f"{table}: a table is a .csv or a .parquet file")
    counts: dict[str, int] = {}
    shown: list[tuple[float, int, Row]] = []
    with tempfile.TemporaryDirectory(prefix="isv-batch-") as folder:
        local = Path(folder) / "table"
        writer = _CsvTable(local) if ending == ".csv" else _ParquetTable(local)
        for number, row in enumerate(rows(plan, output)):
            counts[row["status"]] = counts.get(row["status"], 0) + 1
            writer.add(row)
            urgency = (_urgency(row), -number, row)
            heapq.heappush(shown, urgency) if len(shown) < page else heapq.heappushpop(shown, urgency)
        writer.close()
        output.publish(local, table)
    worst = [row for _, _, row in sorted(shown, key=lambda entry: entry[:2], reverse=True)]
    output.publish_bytes(_page(worst, counts, table).encode(), "index.html")
    return counts


def _urgency(row: Row) -> float:
    """Place of a take on the page: failed ones first, then by their largest error."""
    if row["status"] == "failed":
        return float("inf")
    return float(row.get("worst_rms_mm") or -1.0)


class _CsvTable:
    def __init__(self, path: Path) -> None:
        self._file = path.open("w", newline="", encoding="utf-8")
        self._writer = csv.DictWriter(self._file, list(COLUMNS), extrasaction="ignore")
        self._writer.writeheader()

    def add(self, row: Row) -> None:
        self._writer.writerow(row)

    def close(self) -> None:
        self._file.close()


class _ParquetTable:
    def __init__(self, path: Path) -> None:
        import pyarrow
        import pyarrow.parquet

        kinds: dict[type, Any] = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64()}
        self._arrow = pyarrow
        self._schema = pyarrow.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()])
        self._writer = pyarrow.parquet.ParquetWriter(str(path), self._schema)
        self._rows: list[Row] = []

    def add(self, row: Row) -> None:
        self._rows.append({name: row.get(name) for name in COLUMNS})
        if len(self._rows) == _GROUP:
            self._flush()

    def _flush(self) -> None:
        if self._rows:
            self._writer.write_table(self._arrow.Table.from_pylist(self._rows, self._schema))
            self._rows = []

    def close(self) -> None:
        self._flush()
        self._writer.close()


_HEAD = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>isv-batch</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 75rem; padding: 0 1rem; }
article { border-top: 1px solid #ccc; padding: .5rem 0 1rem; }
h2 { font-size: 1.1rem; margin: .3rem 0; }
p { margin: .2rem 0; overflow-wrap: anywhere; }
img { max-width: 100%; }
.failed h2, .failed p { color: #a00; }
</style>
"""


def _page(worst: list[Row], counts: dict[str, int], table: str) -> str:
    """The page: takes with their figures, and pictures of their worst frames."""
    told = ", ".join(f"{counts[name]} {name}" for name in ("done", "failed", "waiting") if counts.get(name))
    head = f'<h1>{sum(counts.values())} takes: {told or "none"}</h1>\n<p>All of them: <a href="{table}">{table}</a>. '
    head += "Below are those that failed, and those with the largest errors.</p>\n"
    return _HEAD + head + "".join(_article(row) for row in worst) + "</html>\n"


def _article(row: Row) -> str:
    name = html.escape(row["take"])
    if row["status"] != "done":
        why = html.escape(row.get("error") or "")
        return f'<article class="{row["status"]}"><h2>{name}: {row["status"]}</h2><p>{why}</p></article>\n'
    figures = f"{row['frames']} frames, {row['mbps']:.3f} Mbps, voxels of {row['voxel_mm']:g} mm"
    if row.get("worst_rms_mm") is not None:
        figures += f"; RMS error {row['p2s_rms_mm']:.3f} mm, in frame {row['worst_frame']} {row['worst_rms_mm']:.3f} mm"
    elif row.get("error"):
        figures += f"; {html.escape(row['error'])}"
    picture = ""
    if row.get("pictures"):
        picture = f'<img loading="lazy" src="takes/{name}/worst.png" alt="Frames of {name} with the largest errors">'
    return f'<article><h2><a href="takes/{name}/take.isv">{name}</a></h2><p>{figures}</p>{picture}</article>\n'
