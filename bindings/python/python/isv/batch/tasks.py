"""Tasks of workers: to plan a take, to measure or encode a shard, and to finish a take.

A task is a dictionary in and a dictionary out, so that any engine can carry it. No task raises: its result says what
went wrong. Tasks may be run twice, also at the same time, and leave the same files.
"""

from __future__ import annotations

import hashlib
import logging
import math
import os
import resource
import shlex
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .._encode import encode
from .._jobs import draw, evaluate, info, join, set_threads, verify
from .plan import key_of, may_pass, plan_take, shard_key
from .rate import PROBES
from .sources import Source
from .storage import Store

__all__ = ["planned_key", "run_task", "shard_name", "take_folder", "take_key"]

Task = dict[str, Any]

_FIGURES = ("p2s_mean_mm", "p2s_rms_mm", "p2s_p99_mm", "hausdorff_mm", "normal_error_deg", "colour_y_psnr_db")
"""Figures of measurements that are kept."""

_SAMPLED = 4
"""One of so many groups of pictures is encoded at the second probe."""


def take_folder(take: Task) -> str:
    """Folder of a take in the output."""
    return f"takes/{take['name']}"


def shard_name(take: Task, shard: Task) -> str:
    """Name of a shard in the output, without its ending."""
    first, end = shard["frames"]
    return f"{take_folder(take)}/shards/{first:07}-{end:07}"


def take_key(take: Task, settings: dict[str, Any], finish: dict[str, Any]) -> str:
    """What a finished take is known by: its shards, and what is made of them."""
    return key_of([shard_key(take, shard, settings) for shard in take["shards"]], finish)


def planned_key(take: Task) -> str:
    """What a take of a plan is known by: its inputs and the settings of the plan, whatever is made of them."""
    return key_of([shard_key(take, shard, take["settings"]) for shard in take["shards"]], take.get("bitrate_mbps"))


def run_task(task: Task) -> Task:
    """Run a task on this machine.

    Returns:
        ``ok``, and with it the figures of the task, or ``error`` and whether trying again may help (``retry``).
    """
    begin, cpu = time.monotonic(), _cpu_seconds()
    if task.get("threads"):
        set_threads(task["threads"])
    try:
        with _Notes() as notes:
            result = _TASKS[task["task"]]({**task, "notes": notes.sentences})
    except MemoryError as error:
        return {"ok": False, "error": f"out of memory: {error}", "retry": False}
    except OSError as error:
        return {"ok": False, "error": _sentence(error), "retry": may_pass(error)}
    except Exception as error:
        return {"ok": False, "error": _sentence(error), "retry": False}
    return {"ok": True, "wall_s": time.monotonic() - begin, "cpu_s": _cpu_seconds() - cpu, **result}


class _Notes(logging.Handler):
    """Collects warnings of the encoder, which would otherwise come from each shard by itself."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.sentences: list[str] = []
        self._logger = logging.getLogger("isv")

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a sentence, once."""
        sentence = record.getMessage()
        if sentence not in self.sentences and len(self.sentences) < 20:
            self.sentences.append(sentence)

    def __enter__(self) -> _Notes:
        self._propagates, self._logger.propagate = self._logger.propagate, False
        self._logger.addHandler(self)
        return self

    def __exit__(self, *failure: object) -> None:
        self._logger.removeHandler(self)
        self._logger.propagate = self._propagates


def _cpu_seconds() -> float:
    """Processor time of this process and of its children (s)."""
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def _sentence(error: BaseException) -> str:
    text = " ".join(str(error).split())
    kind = type(error).__name__
    return text if text and kind in ("IsvError", "ValueError", "OSError", "RuntimeError") else f"{kind}: {text}"


def _scratch(task: Task) -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="isv-batch-", dir=task.get("scratch"), ignore_cleanup_errors=True)


def _plan(task: Task) -> Task:
    return {"take": plan_take(task["name"], task["source"], task["options"], task["shard_frames"])}


def _input(take: Task, shard: Task, scratch: Path) -> tuple[Source, Path]:
    """The frames of a shard where the encoder can read them, once it is sure that they are those of the plan."""
    source = Source(take["source"])
    first, end = shard["frames"]
    if source.fingerprint(first, end, scratch) != shard["inputs"]:
        raise ValueError(f"{take['source']}: frames {first}..{end} have changed since they were planned; plan again")
    return source, source.local(scratch, first, end)


def _measure(task: Task) -> Task:
    """Encode a shard at the first probe, and some of its groups at the second."""
    take, shard = task["take"], task["shard"]
    store, name = Store(task["output"]), shard_name(take, shard) + ".statistics.json"
    settings = take["settings"]
    key = key_of(shard_key(take, shard, settings), PROBES)
    known = store.read_json(name)
    if known is not None and known.get("key") == key and "times_s" in known:
        return {"line": known["line"], "times_s": known["times_s"], "reused": True}
    with _scratch(task) as folder:
        scratch = Path(folder)
        _, path = _input(take, shard, scratch)
        first, end = shard["frames"]
        encode(path, scratch / "probe.isv", frames=(first, end), **_at(settings, PROBES[0]))
        packets = info(scratch / "probe.isv")["packets"]
        gop = settings.get("gop", 30)
        groups = list(range(first, end, gop))[::_SAMPLED] if len(packets) == end - first else [first]
        before = after = 0
        for begin in groups:
            stop = min(begin + gop, end)
            encode(path, scratch / "part.isv", frames=(begin, stop), **_at(settings, PROBES[1]))
            after += sum(packet["bytes"] for packet in info(scratch / "part.isv")["packets"])
            before += sum(packet["bytes"] for packet in packets[begin - first : stop - first])
        line = {
            "at": sum(packet["bytes"] for packet in packets),
            "slope": max(0.0, math.log(after / before) / (PROBES[1] - PROBES[0])),
        }
        times_s = [packets[index]["timestamp_ns"] / 1e9 for index in (0, -1)]
        store.publish_json({"key": key, "line": line, "times_s": times_s, "frames": [first, end]}, name)
        return {"line": line, "times_s": times_s, "reused": False}


def _at(settings: dict[str, Any], quality: float) -> dict[str, Any]:
    """Settings at a quality, which is also that of colour unless colour has one of its own."""
    colour = {} if settings.get("color") is False or "color_quality" in settings else {"color_quality": quality}
    return {**settings, "quality": quality, **colour}


def _encode(task: Task) -> Task:
    """Encode a shard, unless it is there: the stream first, then what says that it is whole."""
    take, shard, settings = task["take"], task["shard"], settings_of(task)
    store, name = Store(task["output"]), shard_name(take, shard)
    key = shard_key(take, shard, settings)
    known = store.read_json(name + ".json")
    if known is not None and known.get("key") == key and store.size(name + ".isv") == known["bytes"]:
        return {"figures": known, "reused": True}
    begin, cpu = time.monotonic(), _cpu_seconds()
    with _scratch(task) as folder:
        scratch = Path(folder)
        _, path = _input(take, shard, scratch)
        first, end = shard["frames"]
        stream = scratch / "shard.isv"
        report = encode(path, stream, frames=(first, end), **settings)
        figures = {
            "key": key,
            "frames": [first, end],
            "inputs": shard["inputs"],
            "settings": settings,
            "coded": report.frames,
            "empty": report.empty,
            "skipped": report.skipped,
            "notes": task["notes"],
            "bytes": report.bytes,
            "sha256": hashlib.sha256(stream.read_bytes()).hexdigest(),
            "worker": f"{socket.gethostname()}:{os.getpid()}",
            "wall_s": round(time.monotonic() - begin, 3),
            "cpu_s": round(_cpu_seconds() - cpu, 3),
        }
        store.publish(stream, name + ".isv")
        store.publish_json(figures, name + ".json")
    return {"figures": figures, "reused": False}


def settings_of(task: Task) -> dict[str, Any]:
    """The settings of a task's shards: those of the plan, at the quality that meets a rate where there is one."""
    settings: dict[str, Any] = task["take"]["settings"]
    return settings if task.get("quality") is None else _at(settings, task["quality"])


def _finish(task: Task) -> Task:
    """Join the shards of a take, check and measure the stream, and draw its worst frames."""
    take, settings, finish = task["take"], settings_of(task), task["finish"]
    store, folder = Store(task["output"]), take_folder(take)
    row: Task = {"key": take_key(take, settings, finish), "take": take["name"], "source": take["source"]}
    begin, cpu = time.monotonic(), _cpu_seconds()
    with _scratch(task) as scratch_folder:
        scratch = Path(scratch_folder)
        parts, figures = [], []
        for number, shard in enumerate(take["shards"]):
            name = shard_name(take, shard)
            known = store.read_json(name + ".json")
            if known is None or known["key"] != shard_key(take, shard, settings):
                raise ValueError(f"{name}.isv: the shard is not there; run the plan again")
            path = store.fetch(name + ".isv", scratch / f"{number}.isv")
            if hashlib.sha256(path.read_bytes()).hexdigest() != known["sha256"]:
                # What is damaged is encoded again by the next run.
                store.remove(name + ".json")
                raise ValueError(f"{name}.isv: the shard is damaged; run the plan again")
            parts.append(path)
            figures.append(known)
        # A shard may have nobody on stage, but not all of them.
        if sum(part.get("empty", 0) for part in figures) == sum(part["coded"] for part in figures):
            raise ValueError(f"{take['source']}: no surface in any frame")
        stream = scratch / "take.isv"
        frames = join(parts, stream, keep_times=True)
        verified, _ = verify(stream)
        facts = info(stream)
        row |= {
            "status": "done",
            "planned": planned_key(take),
            "frames": frames,
            "seconds": round(facts["duration_s"], 6),
            "bytes": facts["bytes"],
            "mbps": facts["bitrate_mbps"],
            "voxel_mm": 1e3 * facts["voxel_size_m"],
            "sign": settings.get("sign"),
            "quality": settings.get("quality"),
            "shards": len(parts),
            "skipped": sum(part["skipped"] for part in figures),
            "notes": sorted({sentence for part in figures for sentence in part["notes"]}),
        }
        if verified != frames:
            raise ValueError(f"{folder}/take.isv: {verified} of {frames} frames are sound")
        row["errors"] = _errors(take, figures, stream, scratch, finish)
        pictures = _pictures(take, row["errors"], stream, scratch, finish)
        made = _package(finish, stream, take, scratch)
        row["encode_cpu_s"] = round(sum(part["cpu_s"] for part in figures), 3)
        row["finish_cpu_s"] = round(_cpu_seconds() - cpu, 3)
        row["finish_wall_s"] = round(time.monotonic() - begin, 3)
        store.publish(stream, f"{folder}/take.isv")
        if pictures is not None:
            store.publish(pictures, f"{folder}/worst.png")
        row["pictures"] = pictures is not None
        for path in made:
            store.publish(path, f"{folder}/package/{path.relative_to(scratch / 'package').as_posix()}")
        store.remove(f"{folder}/error.json")
        store.sweep(folder)
        store.publish_json(row, f"{folder}/take.json")
        if finish["discard_shards"]:
            for shard in take["shards"]:
                for ending in (".json", ".isv", ".statistics.json"):
                    store.remove(shard_name(take, shard) + ending)
    return {"row": row}


def _errors(take: Task, figures: list[Task], stream: Path, scratch: Path, finish: dict[str, Any]) -> Task:
    """Errors of frames spread over a take: their means, and the frames themselves with the worst first."""
    numbers = _pairs(figures)
    count = min(finish["sample"], len(numbers))
    chosen = sorted({numbers[int((number + 0.5) * len(numbers) / count)] for number in range(count)})
    settings = take["settings"]
    source = Source(take["source"])
    measured: list[Task] = []
    why_not = "no frame was to be measured"
    for coded, captured in chosen:
        path = source.local(scratch, captured, captured + 1)
        try:
            found = evaluate(
                path,
                stream,
                spacing=finish["spacing"] or take["voxel"],
                frames=(captured, captured + 1),
                test_frames=(coded, coded + 1),
                units=settings.get("units", "m"),
                origin=settings.get("origin"),
                up=settings.get("up", "y"),
                animation=settings.get("animation"),
                fps=take["fps"],
            )
        except ValueError as error:
            # An empty stage, for example: other frames may have something to measure.
            why_not = _sentence(error)
            continue
        figure = {name: found[name] for name in _FIGURES if isinstance(found.get(name), (int, float))}
        measured.append({"frame": captured, "coded": coded, **figure})
    if not measured:
        return {"why_not": why_not, "frames": []}
    means = {}
    for name in _FIGURES:
        values = [frame[name] for frame in measured if name in frame]
        if values:
            means[name] = sum(values) / len(values)
    measured.sort(key=lambda frame: -float(frame.get("p2s_rms_mm", 0.0)))
    return {**means, "frames": measured}


def _pairs(figures: list[Task]) -> list[tuple[int, int]]:
    """Numbers of frames in the stream and in the capture, but for shards in which frames were left out."""
    pairs, coded = [], 0
    for part in figures:
        first, end = part["frames"]
        if part["skipped"] == 0 and part["coded"] == end - first:
            pairs += [(coded + number, first + number) for number in range(end - first)]
        coded += part["coded"]
    return pairs


def _pictures(take: Task, errors: Task, stream: Path, scratch: Path, finish: dict[str, Any]) -> Path | None:
    """A contact sheet of the frames with the largest errors, coloured by these where the capture has surfaces."""
    worst = errors["frames"][: finish["pictures"]]
    if finish["pictures"] == 0:
        return None
    settings, picture = take["settings"], scratch / "worst.png"
    frames = [frame["coded"] for frame in worst] or [0]
    offsets = {frame["frame"] - frame["coded"] for frame in worst}
    reference: dict[str, Any] = {}
    if len(offsets) == 1:
        source = Source(take["source"])
        for frame in worst:
            path = source.local(scratch, frame["frame"], frame["frame"] + 1)
        reference = {
            "against": path,
            "against_first": offsets.pop(),
            "units": settings.get("units", "m"),
            "origin": settings.get("origin"),
            "up": settings.get("up", "y"),
            "animation": settings.get("animation"),
            "fps": take["fps"],
            "error_range": max(take["voxel"] / 2, 5e-4),
        }
    for against in (reference, {}):
        try:
            draw(stream, picture, frames, size=finish["picture_size"], columns=len(frames), **against)
            return picture
        except ValueError:
            # Points have no surface to measure against, and a frame may have none to draw.
            continue
    return None


def _package(finish: dict[str, Any], stream: Path, take: Task, scratch: Path) -> list[Path]:
    """Run the command that packages a stream, and list the files that it made."""
    if not finish["package"]:
        return []
    folder = scratch / "package"
    folder.mkdir()
    words = [
        word.format(stream=stream, folder=folder, name=take["name"], fps=take["fps"])
        for word in shlex.split(finish["package"])
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = " ".join(done.stderr.split())[-300:]
        raise RuntimeError(f"{words[0]} ended with status {done.returncode}: {said}")
    made = sorted(path for path in folder.rglob("*") if path.is_file())
    if not made:
        raise RuntimeError(f"{words[0]} wrote nothing into {{folder}}, which the command must name")
    return made


_TASKS: dict[str, Callable[[Task], Task]] = {
    "plan": _plan,
    "measure": _measure,
    "encode": _encode,
    "finish": _finish,
}
