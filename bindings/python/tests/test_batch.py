"""Batch encoding without a cluster: plans, shards, what is done again, reports, and jobs for other schedulers."""

from __future__ import annotations

import csv
import errno
import json
import os
import resource
import shutil
import subprocess
import sys
import textwrap
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import isv
import isv.batch.plan as batch_plan
import pytest
from isv.batch import Choices, InlineEngine, LocalEngine, Plan, Store, Summary, plan_takes, run, write_plan
from isv.batch.cli import main
from isv.batch.driver import TakeRun
from isv.batch.engines import ordered
from isv.batch.plan import shard_length
from isv.batch.rate import PROBES, Line, corrected, quality_for
from isv.batch.report import rows, status, write_report
from isv.batch.sources import Source, find_takes
from isv.batch.tasks import run_task

from conftest import Command, box, half_written, skip_without, write_ply, write_take

COARSE = 0.04
BARE = Choices(sample=0, pictures=0)
NOBODY = (
    "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 0\nproperty list uchar int vertex_indices\nend_header\n"
)


def planned(folder: Path, takes: Iterable[Path], shard_frames: int = 4, **options: Any) -> Plan:
    """A plan of takes with a group of pictures every two frames."""
    options = {"voxel": COARSE, "gop": 2, **options}
    found = (found for take in takes for found in find_takes(str(take)))
    with InlineEngine() as engine:
        planned_takes = plan_takes(found, options, shard_frames, lambda tasks: ordered(engine, tasks))
        write_plan(folder / "plan.json", {"options": options}, planned_takes)
    return Plan.open(folder / "plan.json")


def inline(plan: Plan, output: Path, choices: Choices = BARE) -> Summary:
    with InlineEngine() as engine:
        return run(plan, Store(str(output)), engine, choices)


def serial(take: Path, path: Path, **options: Any) -> bytes:
    settings: dict[str, Any] = {"voxel": COARSE, "gop": 2, "fixed_gop": True, **options}
    isv.encode(take, path, **settings)
    return path.read_bytes()


@pytest.mark.parametrize(
    "options",
    [{}, {"quality": 80.0}, {"max_error": 0.01}, {"profile": "paper"}, {"fps": 12.5, "units": "dm", "voxel": 0.004}],
    ids=["defaults", "quality", "error", "paper", "units"],
)
def test_joined_shards_are_the_bytes_of_one_encoder(tmp_path: Path, options: dict[str, Any]) -> None:
    takes = [write_take(tmp_path / "boxes", 9), write_take(tmp_path / "painted", 5, colored=True)]
    summary = inline(planned(tmp_path, takes, **options), tmp_path / "out")
    assert (summary.done, summary.encoded, summary.failed) == (2, 5, [])
    for take in takes:
        found = (tmp_path / "out" / "takes" / take.name / "take.isv").read_bytes()
        assert found == serial(take, tmp_path / "serial.isv", **options)
    # However long the shards are.
    inline(planned(tmp_path, takes, shard_frames=2, **options), tmp_path / "other")
    for take in takes:
        names = [tmp_path / name / "takes" / take.name / "take.isv" for name in ("out", "other")]
        assert names[0].read_bytes() == names[1].read_bytes()


def test_joined_shards_are_the_bytes_of_the_command_line(tmp_path: Path, command: Command) -> None:
    take = write_take(tmp_path / "boxes", 6)
    (take / "frame_0003.ply").rename(take / "frame_0103.ply")
    inline(planned(tmp_path, [take]), tmp_path / "out")
    command("encode", take, "-o", tmp_path / "serial.isv", "--voxel", "40mm", "--gop", 2, "--fixed-gop")
    found = (tmp_path / "out" / "takes" / "boxes" / "take.isv").read_bytes()
    assert found == (tmp_path / "serial.isv").read_bytes()


def test_a_take_is_closed_or_open_as_a_whole(tmp_path: Path) -> None:
    closed = write_take(tmp_path / "closed", 8)
    opens = write_take(tmp_path / "opens", 8, open_from=4)
    signs = {take["name"]: take["settings"]["sign"] for take in planned(tmp_path, [closed, opens]).takes()}
    assert signs == {"closed": "closed", "opens": "sheet"}


def test_a_shard_without_colour_has_a_place_for_it_where_the_take_has_colour(tmp_path: Path) -> None:
    take = write_take(tmp_path / "painted", 8, colored=True)
    for number in range(4, 8):
        write_ply(take / f"frame_{number:04}.ply", box(0.01 * number))
    inline(planned(tmp_path, [take]), tmp_path / "out")
    assert isv.info(tmp_path / "out" / "takes" / "painted" / "take.isv")["frames"] == 8
    # The other way round there is no colour: what the first frame has not, encoding leaves out.
    for number in range(8):
        write_ply(take / f"frame_{number:04}.ply", box(0.01 * number, colored=number > 3))
    plan = planned(tmp_path, [take])
    assert next(plan.takes())["settings"]["color"] is False
    assert inline(plan, tmp_path / "out").done == 1


def test_a_shard_may_have_nobody_on_stage(tmp_path: Path) -> None:
    take = write_take(tmp_path / "painted", 8, colored=True)
    for number in range(4):
        (take / f"frame_{number:04}.ply").write_text(NOBODY)
    plan = planned(tmp_path, [take])
    assert inline(plan, tmp_path / "out", Choices(sample=8, pictures=1, picture_size=64)).failed == []
    # Metadata of shards differ, as one of them has no surface to tell of.
    serial(take, tmp_path / "serial.isv")
    found = isv.info(tmp_path / "out" / "takes" / "painted" / "take.isv")
    assert found["packets"] == isv.info(tmp_path / "serial.isv")["packets"] and found["bytes_colour"] > 0
    # What can be measured is.
    (row,) = rows(plan, Store(str(tmp_path / "out")))
    assert [frame["frame"] >= 4 for frame in row["errors"]["frames"]] == [True] * 4 and row["error"] is None
    # What another plan has made is not done.
    output = Store(str(tmp_path / "out"))
    assert status(planned(tmp_path, [take], quality=20), output).done == 0
    assert status(planned(tmp_path, [take]), output).done == 1
    for number in range(4, 8):
        (take / f"frame_{number:04}.ply").write_text(NOBODY)
    refused = inline(planned(tmp_path, [take]), tmp_path / "empty")
    assert "no surface in any frame" in refused.failed[0][1]


def test_what_cannot_be_cut_is_one_shard(tmp_path: Path) -> None:
    take = write_take(tmp_path / "boxes", 9)
    plan = planned(tmp_path, [take], refresh="gradual")
    described = next(plan.takes())
    assert len(described["shards"]) == 1 and "keyframe" in described["whole"]
    inline(plan, tmp_path / "out")
    expected = serial(take, tmp_path / "serial.isv", refresh="gradual", fixed_gop=False)
    assert (tmp_path / "out" / "takes" / "boxes" / "take.isv").read_bytes() == expected


def test_a_run_goes_on_where_it_stopped_and_redoes_what_has_changed(tmp_path: Path) -> None:
    takes = [write_take(tmp_path / "a", 8), write_take(tmp_path / "b", 8)]
    out = tmp_path / "out"
    plan = planned(tmp_path, takes)
    assert inline(plan, out).encoded == 4
    again = inline(plan, out)
    assert (again.done, again.reused, again.encoded, again.kept) == (0, 2, 0, 4)
    # One shard is lost with its take: as if the run had been stopped before it.
    shards = out / "takes" / "a" / "shards"
    (shards / "0000004-0000008.json").unlink()
    (out / "takes" / "a" / "take.json").unlink()
    again = inline(plan, out)
    assert (again.done, again.reused, again.encoded, again.kept) == (1, 1, 1, 3)
    # Inputs of finished takes are not looked at again.
    frame = takes[0] / "frame_0005.ply"
    as_planned = frame.read_bytes()
    write_ply(frame, box(0.3))
    again = inline(plan, out)
    assert (again.done, again.reused, again.failures) == (0, 2, 0)
    frame.write_bytes(as_planned)
    # An input changes: the plan of before refuses it, a new one redoes the shard that it is in.
    before = (out / "takes" / "b" / "take.isv").read_bytes()
    (out / "takes" / "b" / "take.json").unlink()
    (shards.parent.parent / "b" / "shards" / "0000004-0000008.json").unlink()
    write_ply(takes[1] / "frame_0005.ply", box(0.3))
    refused = inline(plan, out)
    assert refused.failures == 1 and "frames 4..8 have changed" in refused.failed[0][1]
    assert (out / "takes" / "b" / "take.isv").read_bytes() == before
    again = inline(planned(tmp_path, takes), out)
    assert (again.done, again.reused, again.encoded, again.kept) == (1, 1, 1, 3)
    assert (out / "takes" / "b" / "take.isv").read_bytes() == serial(takes[1], tmp_path / "serial.isv")
    assert [row["status"] for row in rows(plan, Store(str(out)))] == ["done", "done"]
    # Other settings are another stream.
    assert inline(planned(tmp_path, takes, quality=20), out).encoded == 4


def test_a_damaged_shard_is_not_joined_and_is_encoded_again(tmp_path: Path) -> None:
    plan, out = planned(tmp_path, [write_take(tmp_path / "a", 8)]), tmp_path / "out"
    inline(plan, out)
    expected = (out / "takes" / "a" / "take.isv").read_bytes()
    (out / "takes" / "a" / "take.json").unlink()
    shard = out / "takes" / "a" / "shards" / "0000000-0000004.isv"
    data = bytearray(shard.read_bytes())
    data[len(data) // 2] ^= 1
    shard.write_bytes(data)
    failed = inline(plan, out)
    assert failed.failures == 1 and "damaged" in failed.failed[0][1]
    assert inline(plan, out).encoded == 1
    assert (out / "takes" / "a" / "take.isv").read_bytes() == expected


def test_a_take_that_fails_stops_no_other_and_is_told_of(tmp_path: Path) -> None:
    takes = [write_take(tmp_path / name, 8) for name in ("a", "b", "c")]
    (takes[1] / "frame_0006.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 5\n")
    (tmp_path / "empty").mkdir()
    plan = planned(tmp_path, [*takes, tmp_path / "empty"])
    summary = inline(plan, tmp_path / "out")
    assert summary.done == 2 and summary.failures == 2
    errors = dict(summary.failed)
    assert "frame_0006.ply" in errors["b"] and "empty" in errors["empty"]
    assert not (tmp_path / "out" / "takes" / "b" / "take.isv").exists() and half_written(tmp_path / "out") == []
    for name in ("a", "c"):
        expected = serial(tmp_path / name, tmp_path / "serial.isv")
        assert (tmp_path / "out" / "takes" / name / "take.isv").read_bytes() == expected
    page = write_report(plan, Store(str(tmp_path / "out")))
    assert page == {"done": 2, "failed": 2}
    text = (tmp_path / "out" / "index.html").read_text()
    assert text.index("frame_0006.ply") < text.index("takes/a/take.isv")
    # Frames that cannot be read may be left out; the others are those of one encoder.
    plan = planned(tmp_path, takes[1:2], skip_bad_frames=True)
    assert inline(plan, tmp_path / "skipping").done == 1
    expected = serial(takes[1], tmp_path / "serial.isv", skip_bad_frames=True)
    assert (tmp_path / "skipping" / "takes" / "b" / "take.isv").read_bytes() == expected
    assert next(rows(plan, Store(str(tmp_path / "skipping"))))["skipped"] == 1


def test_a_full_disk_leaves_nothing_half_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    takes = [write_take(tmp_path / name, 8) for name in ("a", "b", "c")]
    plan, out = planned(tmp_path, takes), tmp_path / "out"
    tries = []

    def fill(store: Store, local: str, part: str) -> None:
        if "/takes/b/" in part and part.split("/")[-1].startswith(".0000004"):
            tries.append(part)
            Path(part).write_bytes(Path(local).read_bytes()[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), part)
        shutil.copyfile(local, part)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "_copy", fill)
        summary = inline(plan, out)
    assert summary.done == 2 and "No space left" in dict(summary.failed)["b"]
    assert len(tries) == 1 and half_written(out) == []
    assert not (out / "takes" / "b" / "take.isv").exists()
    again = inline(plan, out)
    assert (again.done, again.encoded, again.kept) == (1, 1, 5)
    assert (out / "takes" / "b" / "take.isv").read_bytes() == serial(takes[1], tmp_path / "serial.isv")


def test_what_may_pass_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = planned(tmp_path, [write_take(tmp_path / "a", 4)])
    copy, left = Store._copy, [2]

    def drop(store: Store, local: str, part: str) -> None:
        left[0] -= 1
        if left[0] >= 0:
            raise OSError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
        copy(store, local, part)

    monkeypatch.setattr(Store, "_copy", drop)
    assert inline(plan, tmp_path / "out").done == 1
    # It is tried three times in all. What is written then is why it failed.
    left[0] = 3
    failed = inline(plan, tmp_path / "other")
    assert failed.failures == 1 and left[0] == -1
    assert (tmp_path / "other" / "takes" / "a" / "error.json").exists()


def test_a_remote_take_is_planned_again_when_the_network_comes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here, remote = str(write_take(tmp_path / "a", 2)), "s3://bucket/a"
    really, left = batch_plan._plan_take, [2]

    def drop(name: str, source: Source, *rest: Any) -> dict[str, Any]:
        left[0] -= 1
        if left[0] >= 0:
            raise OSError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
        return really(name, Source(here), *rest)

    monkeypatch.setattr(batch_plan, "_PAUSES_S", (0.0, 0.0))
    monkeypatch.setattr(batch_plan, "_plan_take", drop)
    assert "error" not in batch_plan.plan_take("a", remote, {"voxel": COARSE}, 30)
    # Three tries in all, and one where there is no network.
    for source, tries in ((remote, 3), (here, 1)):
        left[0] = 9
        assert "reset" in batch_plan.plan_take("a", source, {"voxel": COARSE}, 30)["error"]
        assert left[0] == 9 - tries


def test_lines_add_up_to_the_rate() -> None:
    lines = [Line(1000.0, 0.02), Line(5000.0, 0.03)]
    for target in (2000.0, 6000.0, 9000.0):
        quality = quality_for(lines, target)
        assert sum(line.bytes(quality) for line in lines) == pytest.approx(target, rel=1e-3)
    assert quality_for(lines, 1.0) == 0.0 and quality_for(lines, 1e9) == pytest.approx(100.0, abs=0.01)
    assert corrected(50.0, 1.005, 1.0, lines) is None
    lower, higher = corrected(50.0, 1.1, 1.0, lines), corrected(50.0, 0.9, 1.0, lines)
    assert lower is not None and higher is not None and lower < 50.0 < higher
    assert corrected(0.0, 2.0, 1.0, lines) is None, "nothing is coarser"


def test_a_bit_rate_is_met_over_shards(tmp_path: Path) -> None:
    take = write_take(tmp_path / "boxes", 24)
    # What one quality takes is a rate that can be met.
    wanted = len(serial(take, tmp_path / "at.isv", quality=62, voxel=0.02)) * 8 / (24 / 30) / 1e6
    plan = planned(tmp_path, [take], shard_frames=8, voxel=0.02, bitrate_mbps=wanted)
    assert inline(plan, tmp_path / "out").done == 1
    folder = tmp_path / "out" / "takes" / "boxes"
    rate = json.loads((folder / "rate.json").read_text())
    assert len(rate["budgets"]) == 3 and sum(rate["budgets"]) == pytest.approx(rate["target_bytes"], rel=0.1)
    stream = folder / "take.isv"
    assert 0.95 * wanted < isv.info(stream)["bitrate_mbps"] <= 1.01 * wanted
    assert stream.read_bytes() == serial(take, tmp_path / "serial.isv", quality=rate["quality"], voxel=0.02)
    # Statistics and shards of a run that was stopped are used again.
    (folder / "take.json").unlink()
    again = inline(plan, tmp_path / "out")
    assert (again.encoded, again.kept) == (0, 3)
    (folder / "rate.json").unlink()
    again = inline(plan, tmp_path / "out")
    assert again.done == 0 or again.encoded == 0 or rate["rounds"] > 0
    figures = run_task({"task": "measure", **_first_shard(plan, tmp_path / "out")})
    assert figures["ok"] and figures["reused"] and figures["line"] == rate["lines"][0]
    assert rate["lines"][0]["slope"] > 0 and PROBES[0] < PROBES[1]


def test_pauses_count_in_a_bit_rate(tmp_path: Path) -> None:
    stream = tmp_path / "paused.isv"
    with isv.Writer(stream, voxel=0.02, gop=2, quality=62) as writer:
        for frame in range(8):
            # Half of the frames follow a pause of 2 s.
            writer.push(box(0.01 * frame), time=frame / 30 + (2 if frame >= 4 else 0))
    assert isv.info(stream)["duration_s"] == pytest.approx(2 + 8 / 30, abs=0.01)
    wanted = isv.info(stream)["bitrate_mbps"]
    plan = planned(tmp_path, [stream], voxel=0.02, bitrate_mbps=wanted)
    assert inline(plan, tmp_path / "out").done == 1
    facts = isv.info(tmp_path / "out" / "takes" / "paused.isv" / "take.isv")
    assert facts["duration_s"] == pytest.approx(2 + 8 / 30, abs=0.01)
    assert 0.9 * wanted < facts["bitrate_mbps"] <= 1.02 * wanted


def _first_shard(plan: Plan, output: Path) -> dict[str, Any]:
    take = next(plan.takes())
    return {"take": take, "shard": take["shards"][0], "output": str(output)}


def test_finished_takes_are_measured_drawn_and_packaged(tmp_path: Path) -> None:
    takes = [write_take(tmp_path / "fine", 8), write_take(tmp_path / "points", 1)]
    (takes[1] / "frame_0000.ply").unlink()
    (takes[1] / "frame_0000.xyz").write_text(
        "\n".join(f"{x / 20} {y / 20} 0 0 0 1" for x in range(20) for y in range(20))
    )
    package = "cp {stream} {folder}/{name}-{fps}.isv"
    choices = Choices(sample=3, pictures=2, picture_size=64, package=package, discard_shards=True)
    plan = planned(tmp_path, takes)
    assert inline(plan, tmp_path / "out", choices).done == 2
    folder = tmp_path / "out" / "takes" / "fine"
    assert (folder / "package" / "fine-30.0.isv").read_bytes() == (folder / "take.isv").read_bytes()
    assert list((folder / "shards").iterdir()) == []
    row = json.loads((folder / "take.json").read_text())
    frames = row["errors"]["frames"]
    assert sorted(frame["frame"] for frame in frames) == [1, 4, 6]
    assert frames[0]["p2s_rms_mm"] == max(frame["p2s_rms_mm"] for frame in frames) > 0
    # The figures are those of the frames themselves.
    one = isv.evaluate(takes[0], folder / "take.isv", spacing=COARSE, frames=(4, 5), test_frames=(4, 5))
    assert [f["p2s_rms_mm"] for f in frames if f["frame"] == 4] == [one["p2s_rms_mm"]]
    picture = (folder / "worst.png").read_bytes()
    assert picture.startswith(b"\x89PNG") and int.from_bytes(picture[16:20], "big") >= 2 * 64
    # Points and their figures: there is no surface to draw errors against.
    assert (tmp_path / "out" / "takes" / "points" / "worst.png").exists()
    again = inline(plan, tmp_path / "out", choices)
    assert (again.reused, again.encoded, again.kept) == (2, 0, 0), "discarded shards are not there"
    # What is made of shards can change without them; here they are gone, and are encoded again.
    again = inline(plan, tmp_path / "out", Choices(sample=1, pictures=0))
    assert (again.done, again.encoded) == (2, 3)
    failed = inline(plan, tmp_path / "out", Choices(sample=0, pictures=0, package="false"))
    assert failed.failures == 2 and "false ended with status 1" in failed.failed[0][1]


def test_tables_say_the_same_as_csv_and_as_parquet(tmp_path: Path) -> None:
    try:
        from pyarrow import parquet
    except ImportError:
        skip_without("pyarrow", "PyArrow is not installed")
    takes = [write_take(tmp_path / "a", 4), write_take(tmp_path / "b", 4)]
    plan, store = planned(tmp_path, [*takes, write_take(tmp_path / "c", 0)]), Store(str(tmp_path / "out"))
    inline(plan, tmp_path / "out", Choices(sample=2, pictures=0))
    for table in ("takes.csv", "takes.parquet"):
        assert write_report(plan, store, table) == {"done": 2, "failed": 1}
    with (tmp_path / "out" / "takes.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    columns = parquet.read_table(tmp_path / "out" / "takes.parquet").to_pylist()
    assert [line["take"] for line in lines] == ["a", "b", "c"]
    for line, column in zip(lines, columns, strict=True):
        assert line == {name: "" if value is None else str(value) for name, value in column.items()}
    assert float(lines[0]["p2s_rms_mm"]) > 0 and lines[2]["status"] == "failed"


def test_a_worker_that_is_killed_is_replaced_and_what_kills_workers_is_found(tmp_path: Path) -> None:
    takes = [write_take(tmp_path / name, 4) for name in ("bad", "a", "b", "c")]
    package = "sh -c 'case {name} in bad) kill -9 $PPID;; *) cp {stream} {folder};; esac'"
    plan, out = planned(tmp_path, takes), tmp_path / "out"
    with LocalEngine(2, retries=1) as engine:
        summary = run(plan, Store(str(out)), engine, Choices(sample=0, pictures=0, package=package))
    assert summary.done == 3 and dict(summary.failed) == {"bad": "its process died 2 times"}
    assert half_written(out, killed=True) == [] and not (out / "takes" / "bad" / "take.json").exists()
    # What was left behind goes when it is old.
    left = [out / "takes" / "a" / "shards" / f".{name}.isv.part" for name in ("old", "new")]
    for path in left:
        path.write_bytes(b"half")
    os.utime(left[0], (0, 0))
    (out / "takes" / "a" / "take.json").unlink()
    assert inline(plan, out, Choices(sample=0, pictures=0)).done >= 1
    assert [path.exists() for path in left] == [False, True]
    for name in ("a", "b", "c"):
        expected = serial(tmp_path / name, tmp_path / "serial.isv")
        assert (out / "takes" / name / "package" / "take.isv").read_bytes() == expected


def test_takes_are_found_in_folders_files_and_patterns(tmp_path: Path) -> None:
    for name in ("one", "two words"):
        write_take(tmp_path / "takes" / name, 2)
    isv.encode(tmp_path / "takes" / "one", tmp_path / "takes" / "three.isv", voxel=COARSE)
    found = list(find_takes(str(tmp_path / "takes")))
    assert [name for name, _ in found][:2] == ["one", "three.isv"] and found[2][0].startswith("two_words-")
    assert list(find_takes(str(tmp_path / "takes" / "one"))) == [("one", str(tmp_path / "takes" / "one"))]
    pattern = str(tmp_path / "takes" / "one" / "*.ply")
    assert list(find_takes(pattern)) == [("one", pattern)]
    with pytest.raises(FileNotFoundError, match="gone"):
        list(find_takes(str(tmp_path / "gone")))
    plan = planned(tmp_path, [tmp_path / "takes"])
    assert inline(plan, tmp_path / "out").done == 3
    assert shard_length(30, None) == 300 and shard_length(7, None) == 301 and shard_length(1000, None) == 1000
    with pytest.raises(ValueError, match="multiple of --gop"):
        shard_length(30, 100)


def write_depth_take(folder: Path, frames: int) -> Path:
    """Write a take of flat depth images at 1 m, as 16-bit PNG files beside their calibration."""
    (folder / "depth").mkdir(parents=True)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")

    wide, high = 64, 48
    lines = (b"\0" + (1000).to_bytes(2, "big") * wide) * high
    head = wide.to_bytes(4, "big") + high.to_bytes(4, "big") + bytes([16, 0, 0, 0, 0])
    picture = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")
    for number in range(frames):
        (folder / "depth" / f"frame_{number:04}.png").write_bytes(b"\x89PNG\r\n\x1a\n" + picture)
    pose = [[float(row == column) for column in range(4)] for row in range(4)]
    lens = {"width": wide, "height": high, "fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0, "depth_scale_m": 0.001}
    (folder / "camera.json").write_text(json.dumps({**lens, "fps": 30, "poses": [pose] * frames}))
    return folder


def test_takes_of_several_folders_have_names_of_their_own(tmp_path: Path) -> None:
    for take in ("walk/1", "walk/2", "walk-1", "other/walk/1", "other/walk/3"):
        write_take(tmp_path / take, 2)
    folders = [str(tmp_path / folder) for folder in ("walk-1", "walk", "other/walk")]
    plan = tmp_path / "plan.json"
    assert main(["plan", *folders, "-o", str(plan), "--voxel", "4cm"]) == 0
    names = [take["name"] for take in Plan.open(plan).takes()]
    assert names == ["walk-1", "walk-1-2", "walk-2", "walk-3-1", "walk-3-3"]
    # What one folder has in common with its take is no second take.
    write_take(tmp_path / "lone" / "lone", 2)
    write_take(tmp_path / "lone" / "b", 2)
    assert main(["plan", str(tmp_path / "lone"), "-o", str(plan), "--voxel", "4cm"]) == 0
    assert [take["name"] for take in Plan.open(plan).takes()] == ["b", "lone"]


def test_links_to_folders_are_followed_and_loops_left_out(tmp_path: Path) -> None:
    real, take = write_depth_take(tmp_path / "real", 2), tmp_path / "take"
    take.mkdir()
    (take / "depth").symlink_to(real / "depth")
    (take / "camera.json").symlink_to(real / "camera.json")
    plan = planned(tmp_path, [take])
    described = next(plan.takes())
    assert described.get("error") is None and described["frames"] == [0, 2]
    # Images behind the link are inputs.
    assert inline(plan, tmp_path / "out").done == 1
    assert described["shards"][0]["inputs"] == Source(str(take)).fingerprint(0, 2, tmp_path)
    (real / "depth" / "frame_0001.png").write_bytes(b"another")
    assert described["shards"][0]["inputs"] != Source(str(take)).fingerprint(0, 2, tmp_path)
    # Two links to one folder are two folders. A link to a folder above has no files of its own.
    (take / "other").symlink_to(real / "depth")
    (real / "depth" / "up").symlink_to(take)
    (take / "itself").symlink_to(take)
    depths = [f"{folder}/frame_{number:04}.png" for folder in ("depth", "other") for number in range(2)]
    names = Store(str(take)).names()
    assert names == ["camera.json", *depths]
    assert Store(str(tmp_path / "gone")).names() == [] == Store(str(take / "camera.json")).names()


class Simulated:
    """An engine whose tasks are done at once, without any work."""

    def __init__(self) -> None:
        self._waiting: list[dict[str, Any]] = []

    def __enter__(self) -> Simulated:
        return self

    def __exit__(self, *failure: object) -> None: ...

    def close(self) -> None: ...

    def has_room(self) -> bool:
        return len(self._waiting) < 64

    def submit(self, task: dict[str, Any]) -> None:
        self._waiting.append(task)

    def done(self) -> list[tuple[dict[str, Any], dict[str, Any]]]:
        done, self._waiting = self._waiting, []
        return [(task, self._result(task)) for task in done]

    def _result(self, task: dict[str, Any]) -> dict[str, Any]:
        if task["task"] == "plan":
            shards = [{"frames": [300 * n, 300 * n + 300], "inputs": f"{n:064}"} for n in range(3)]
            take = {"name": task["name"], "source": task["source"], "frames": [0, 900], "fps": 30.0, "voxel": 0.005}
            return {"ok": True, "take": {**take, "settings": {"gop": 30}, "shards": shards}}
        return {"ok": True, "figures": {"bytes": 1}, "reused": False}


class Nowhere(Store):
    """A folder in which nothing is."""

    def read_json(self, name: str) -> dict[str, Any] | None:
        return None


def simulate(folder: Path, takes: int) -> int:
    """Plan and run so many takes without any work. Returns the most memory that the process has taken (KiB)."""

    def found() -> Iterator[tuple[str, str]]:
        for number in range(takes):
            yield f"take_{number:06}", f"/captures/take_{number:06}"

    engine = Simulated()
    planned_takes = plan_takes(found(), {"gop": 30}, 300, lambda tasks: ordered(engine, tasks))
    counts = write_plan(folder / "plan.json", {}, planned_takes)
    summary = run(Plan.open(folder / "plan.json"), Nowhere(str(folder)), engine)
    assert (counts["takes"], counts["shards"]) == (takes, 3 * takes)
    assert (summary.done, summary.encoded) == (takes, 3 * takes)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def test_memory_of_the_driver_does_not_grow_with_the_number_of_takes(tmp_path: Path) -> None:
    def measured(takes: int) -> int:
        text = f"import pathlib, test_batch; print(test_batch.simulate(pathlib.Path({str(tmp_path)!r}), {takes}))"
        return int(subprocess.check_output([sys.executable, "-c", text], cwd=Path(__file__).parent))

    few, many = measured(1_000), measured(100_000)
    assert many < few + 4096, f"{few} KiB for 1,000 takes, {many} for 100,000"
    assert (tmp_path / "plan.json").stat().st_size > 40_000_000, "the plan itself is much larger"


def test_results_come_in_the_order_of_their_tasks() -> None:
    class Backwards(Simulated):
        def done(self) -> list[tuple[dict[str, Any], dict[str, Any]]]:
            return super().done()[::-1]

    tasks = ({"task": "plan", "name": str(number), "source": ""} for number in range(500))
    assert [int(result["take"]["name"]) for result in ordered(Backwards(), tasks)] == list(range(500))


def test_the_command_plans_runs_and_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_take(tmp_path / "takes" / "a", 6)
    write_take(tmp_path / "takes" / "b", 6, colored=True)
    plan, out = tmp_path / "plan.json", tmp_path / "out"
    words = ["plan", tmp_path / "takes", "-o", plan, "--voxel", "4cm", "--gop", 2, "--shard-frames", 2, "--workers", 1]
    assert main([str(word) for word in words]) == 0
    assert "2 takes, 12 frames in 6 shards" in capsys.readouterr().out
    assert main(["status", str(plan)]) == 2
    assert "--output" in capsys.readouterr().err
    words = ["run", plan, "--output", out, "--sample", 2, "--picture-size", 64, "--workers", 2]
    assert main([str(word) for word in words]) == 0
    assert "2 takes done, 0 were there, 0 failed; 6 shards encoded, 0 were there" in capsys.readouterr().out
    assert main([str(word) for word in words]) == 0
    assert "0 takes done, 2 were there, 0 failed; 0 shards encoded, 6 were there" in capsys.readouterr().out
    assert main(["status", str(plan), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["takes"], told["done"], told["waiting"], told["output"]) == (2, 2, 0, str(out))
    assert main(["report", str(plan), "--page", "1"]) == 0
    page = (out / "index.html").read_text()
    assert page.count("<article") == 1 and "2 done" in page
    # A take that fails later is told of, with exit status 1.
    (tmp_path / "takes" / "a" / "frame_0003.ply").write_bytes(b"nothing")
    assert (
        main(["plan", str(tmp_path / "takes"), "-o", str(plan), "--voxel", "4cm", "--gop", "2", "--shard-frames", "2"])
        == 0
    )
    assert main(["run", str(plan), "--output", str(out), "--pictures", "0"]) == 1
    assert "a: " in (told_of := capsys.readouterr().err) and "frame_0003.ply" in told_of
    found = status(Plan.open(plan), Store(str(out)))
    assert (found.done, found.failed, found.waiting, found.shards_done) == (1, 1, 0, 3)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["plan", "TAKE", "-o", "p.json", "--gop", "7", "--shard-frames", "10"], "multiple of --gop"),
        (["plan", "TAKE", "-o", "p.json", "--quality", "3", "--bitrate", "1M"], "only one"),
        (["plan", "TAKE", "-o", "p.json", "--voxel", "5"], "has a unit"),
        (["plan", "-o", "p.json"], "name takes"),
        (["plan", "TAKE", "-o", "p.json", "--address", "auto"], "--engine ray"),
        (["run", "p.json"], "--output"),
    ],
)
def test_a_wrong_command_line_is_status_2(tmp_path: Path, words: list[str], said: str) -> None:
    take = write_take(tmp_path / "take", 1)
    command = [sys.executable, "-m", "isv.batch", *(str(take) if word == "TAKE" else word for word in words)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 2 and said in done.stderr, done.stderr
    assert "Traceback" not in done.stderr and not (tmp_path / "p.json").exists()


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (["--up", "-y"], {"up": "-y"}),
        (["--up=-z"], {"up": "-z"}),
        (["--up", "-x", "--units", "mm"], {"up": "-x", "units": "mm"}),
        (["--up", "z"], {"up": "z"}),
        (["--viewpoint", "-1,0,0"], {"viewpoint": [-1, 0, 0]}),
        (["--viewpoint=-1,0,0"], {"viewpoint": [-1, 0, 0]}),
        (["--view", "-.5,0,-2e-1"], {"viewpoint": [-0.5, 0, -0.2]}),
        (["--origin", "-1,0,0", "--up", "-y"], {"origin": [-1, 0, 0], "up": "-y"}),
    ],
)
def test_values_may_begin_with_a_minus_sign(tmp_path: Path, words: list[str], options: dict[str, Any]) -> None:
    take, plan = write_take(tmp_path / "take", 1), tmp_path / "plan.json"
    given = ["plan", str(take), *words, "-o", str(plan), "--voxel", "4cm", "--workers", "1"]
    assert main(given) == 0
    assert Plan.open(plan).header["options"] == {"voxel": COARSE, **options}


def test_an_option_without_its_value_takes_no_other_option(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["isv-batch", "plan", str(tmp_path), "--up", "-o", "plan.json"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2 and "--up: expected one argument" in capsys.readouterr().err


def test_files_that_are_no_plans_are_refused(tmp_path: Path) -> None:
    for text in ("", "{}", '{"isv_batch_plan": 99}', "[1, 2]"):
        (tmp_path / "p.json").write_text(text)
        with pytest.raises(ValueError, match="plan"):
            Plan.open(tmp_path / "p.json")
    plan = planned(tmp_path, [write_take(tmp_path / "a", 2)])
    assert json.loads(Path(plan.path).read_text())["takes"][0]["name"] == "a", "a plan is JSON"
    text = Path(plan.path).read_text()
    Path(plan.path).write_text(text[: text.rindex("]}")])
    with pytest.raises(ValueError, match="cut off"):
        list(plan.takes())


SBATCH = """
    #!/bin/sh
    # Runs each task of an array at once, and names the job.
    for word; do script=$word; done
    last=$(sed -n 's/^#SBATCH --array=0-//p' "$script")
    for number in $(seq 0 "${last:-0}"); do export SLURM_ARRAY_TASK_ID=$number
        sh "$script" >&2 || echo "failed: $script $number" >&2
    done
    echo 7
"""


@pytest.mark.parametrize("rate", [{}, {"bitrate_mbps": 0.4}], ids=["quality", "rate"])
def test_arrays_of_slurm_make_the_same_streams(tmp_path: Path, rate: dict[str, Any]) -> None:
    takes = [write_take(tmp_path / name, 8) for name in ("a", "b")]
    plan, out = planned(tmp_path, takes, **rate), tmp_path / "out"
    program = tmp_path / "bin" / "sbatch"
    program.parent.mkdir()
    program.write_text(textwrap.dedent(SBATCH).lstrip())
    program.chmod(0o755)
    words = ["export", plan.path, "--output", str(out), "--slurm-array", str(tmp_path / "jobs"), "--sample", "1"]
    assert main([*words, "--pictures", "0"]) == 0
    environment = {**os.environ, "PATH": f"{program.parent}:{os.environ['PATH']}"}
    done = subprocess.run(
        [tmp_path / "jobs" / "submit.sh"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and "failed" not in done.stderr, done.stderr
    for take in takes:
        quality = {}
        if rate:
            state = TakeRun(next(t for t in plan.takes() if t["name"] == take.name), Store(str(out)), BARE)
            quality = {"quality": state.task_of("encode", 0)["quality"]}
        expected = serial(take, tmp_path / "serial.isv", **quality)
        assert (out / "takes" / take.name / "take.isv").read_bytes() == expected
    assert "2 done" in (out / "index.html").read_text()


def test_a_template_of_openjd_is_sound_and_makes_the_same_streams(tmp_path: Path) -> None:
    try:
        import openjd.cli  # type: ignore[import-not-found, import-untyped, unused-ignore]  # noqa: F401
    except ImportError:
        skip_without("openjd", "openjd-cli is not installed")
    take = write_take(tmp_path / "a", 8)
    plan, out, template = planned(tmp_path, [take]), tmp_path / "out", tmp_path / "job.json"
    words = ["export", plan.path, "--output", str(out), "--openjd", str(template), "--sample", "0", "--pictures", "0"]
    assert main(words) == 0
    for command in ("check", "run"):
        words = [str(Path(sys.executable).with_name("openjd")), command, str(template)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    assert (out / "takes" / "a" / "take.isv").read_bytes() == serial(take, tmp_path / "serial.isv")
    assert (out / "index.html").exists()
