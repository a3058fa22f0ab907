"""Plans: what is decided once for each take, so that its shards can be encoded apart.

A plan is a JSON object whose takes stand on a line each, so that plans of any length are written and read take by take.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import IsvError, _isv
from .._jobs import settle
from .sources import Source

__all__ = [
    "SHARD_FRAMES",
    "Plan",
    "key_of",
    "may_pass",
    "plan_take",
    "plan_takes",
    "shard_key",
    "shard_length",
    "write_plan",
]

SHARD_FRAMES = 300
"""Frames of a shard, about: it has whole groups of pictures."""

_MOST_FETCHED = 192
"""Frames at the start of a remote take that are copied at most, where none before has anything in it."""

_PAUSES_S = (1.0, 5.0)
"""Pauses before a remote take is planned again that could not be read."""

_VERSION = 1

Take = dict[str, Any]


def shard_length(gop: int, asked: int | None) -> int:
    """Frames of a shard: what was asked for, or the multiple of the group of pictures nearest to the usual.

    Raises:
        ValueError: What was asked for is no multiple.
    """
    if asked is None:
        return gop * max(1, round(SHARD_FRAMES / gop))
    if asked < gop or asked % gop:
        raise ValueError(f"--shard-frames {asked}: a multiple of --gop, which is {gop}")
    return asked


def key_of(*parts: Any) -> str:
    """A short hash of values that JSON can hold."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:32]


def shard_key(take: Take, shard: Take, settings: dict[str, Any]) -> str:
    """What a shard is known by: the encoder, its settings, its frames and its inputs. Another key is another stream."""
    return key_of(_isv.__version__, settings, shard["frames"], shard["inputs"])


def plan_take(name: str, source: str, options: dict[str, Any], shard_frames: int) -> Take:
    """Decide what must not differ between shards of a take.

    Args:
        name: Name of the take in the output.
        source: Path of the take.
        options: Options of :func:`isv.encode`, and ``frames``.
        shard_frames: Frames of a shard.

    Returns:
        What the plan says of the take. A take that cannot be encoded has an ``error`` in place of shards.
    """
    pauses_s = iter(_PAUSES_S)
    while True:
        try:
            with tempfile.TemporaryDirectory(prefix="isv-batch-") as scratch:
                return _plan_take(name, Source(source), dict(options), shard_frames, Path(scratch))
        except (OSError, ValueError, TypeError) as error:
            passes = isinstance(error, OSError) and may_pass(error) and not Source(source).is_local
            pause_s = next(pauses_s, None) if passes else None
            if pause_s is None:
                return {"name": name, "source": source, "error": f"{error}"}
            time.sleep(pause_s)


def may_pass(error: OSError) -> bool:
    """Whether trying again may help. What is not there and a full disk stay so; a network comes back."""
    lasting = (errno.ENOSPC, errno.EDQUOT, errno.ENOENT, errno.EACCES, errno.ENOTDIR, errno.EROFS)
    return error.errno not in lasting


def _plan_take(name: str, source: Source, options: dict[str, Any], shard_frames: int, scratch: Path) -> Take:
    frames = options.pop("frames", None)
    bitrate = options.pop("bitrate_mbps", None)
    whole = _why_whole(options)
    local = source.local(scratch, 0, 0) if not source.is_local else Path(source.url)
    if not source.is_local:
        _fetch_samples(source, scratch, frames, shard_frames)
    asked = {**options, "every": shard_frames, "frames": tuple(frames) if frames else None}
    decided = _settle(local, source, scratch, frames, asked)
    first, end = decided["frames"]
    if first >= end:
        raise ValueError(f"{source.url}: there are no frames")
    settings = {**options, **_fixed(decided, options)}
    if whole is None:
        settings |= {"fixed_gop": True, "time_origin": first}
    else:
        settings.pop("fixed_gop", None)
        if bitrate is not None:
            settings["bitrate_mbps"] = bitrate
    step = end - first if whole else shard_frames
    shards = []
    for begin in range(first, end, step):
        stop = min(begin + step, end)
        shards.append({"frames": [begin, stop], "inputs": source.fingerprint(begin, stop, scratch)})
    take: Take = {
        "name": name,
        "source": source.url,
        "frames": [first, end],
        "fps": decided["fps"],
        "voxel": decided["voxel"],
        "content": decided["content"],
        "settings": settings,
        "shards": shards,
    }
    if whole is not None:
        take["whole"] = whole
    elif bitrate is not None:
        take["bitrate_mbps"] = bitrate
    return take


def _settle(local: Path, source: Source, scratch: Path, frames: Any, options: dict[str, Any]) -> dict[str, Any]:
    """What must not differ between shards. More frames of a remote take are copied where it begins with nothing."""
    fetched, first = 3, frames[0] if frames else 0
    while True:
        try:
            return settle(local, **options)
        except IsvError:
            # A take in one file has been copied whole.
            if source.is_local or fetched >= _MOST_FETCHED or source.frame_count(scratch) is None:
                raise
            source.local(scratch, first + fetched, first + 2 * fetched)
            fetched *= 2


def _fetch_samples(source: Source, scratch: Path, frames: Any, shard_frames: int) -> None:
    """Copy the frames of a remote take that are looked at: at its start, middle and end, and each shard's first."""
    count = source.frame_count(scratch)
    if count is None:
        source.local(scratch)
        return
    first, end = frames or (0, None)
    end = count if end is None else min(end, count)
    middle = first + (end - first) // 2
    looked_at = {first, first + 1, first + 2, middle, middle + 1, middle + 2, end - 1, *range(first, end, shard_frames)}
    for number in sorted(number for number in looked_at if first <= number < end):
        source.local(scratch, number, number + 1)


def _why_whole(options: dict[str, Any]) -> str | None:
    """Why a take cannot be cut into shards, if it cannot."""
    if options.get("refresh") == "gradual":
        return "gradual refresh has one keyframe"
    if options.get("accumulate_depth"):
        return "depth accumulates from the first frame on"
    if options.get("timestamps") == "clock":
        raise ValueError(
            "--timestamps clock: shards are encoded at different times; source and rate are the same for all"
        )
    return None


def _fixed(decided: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """The options that hold for all shards, in place of those that each would choose by its own first frame."""
    fixed: dict[str, Any] = {}
    if decided["content"] != "volumes":
        # Volumes have a grid of their own, unless another one was asked for.
        fixed["voxel"] = decided["voxel"]
    if decided["sign"] is not None:
        fixed["sign"] = decided["sign"]
    if decided["quality"] is not None and "max_error" not in options:
        fixed["quality"] = decided["quality"]
    if decided["color"]:
        fixed["expect_color"] = True
    else:
        fixed["color"] = False
    return fixed


@dataclass(frozen=True)
class Plan:
    """A plan in a file.

    Attributes:
        path: The file.
        header: What holds for all takes: options, frames of a shard, version.
    """

    path: str
    header: dict[str, Any]

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Plan:
        """Read the head of a plan.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is no plan, or one of another version.
        """
        name = os.fspath(path)
        with open(name, encoding="utf-8") as file:
            line = file.readline()
            try:
                header = json.loads(line.rstrip().removesuffix(',"takes":[') + "}")
            except ValueError:
                header = None
        if not isinstance(header, dict) or "isv_batch_plan" not in header:
            raise ValueError(f"{name}: this is no plan of isv-batch")
        if header["isv_batch_plan"] != _VERSION:
            raise ValueError(f"{name}: a plan of version {header['isv_batch_plan']}; plan again with this isv-batch")
        return cls(name, header)

    def takes(self) -> Iterator[Take]:
        """The takes, one by one."""
        with open(self.path, encoding="utf-8") as file:
            next(file)
            for line in file:
                text = line.strip().rstrip(",")
                if text == "]}":
                    return
                take: Take = json.loads(text)
                yield take
        raise ValueError(f"{self.path}: the plan is cut off; plan again")


def write_plan(path: str | os.PathLike[str], header: dict[str, Any], takes: Iterable[Take]) -> dict[str, int]:
    """Write a plan, which has its name once it is whole.

    Returns:
        The number of ``takes``, ``frames``, ``shards``, and of takes that cannot be encoded (``failed``).
    """
    name = os.fspath(path)
    counts = {"takes": 0, "frames": 0, "shards": 0, "failed": 0}
    part = f"{name}.{os.getpid()}.part"
    try:
        with open(part, "w", encoding="utf-8") as file:
            head = json.dumps({"isv_batch_plan": _VERSION, **header}, sort_keys=True)
            file.write(head.removesuffix("}") + ',"takes":[\n')
            separator = ""
            for take in takes:
                file.write(separator + json.dumps(take, sort_keys=True))
                separator = ",\n"
                counts["takes"] += 1
                counts["failed"] += "error" in take
                counts["shards"] += len(take.get("shards", []))
                counts["frames"] += sum(shard["frames"][1] - shard["frames"][0] for shard in take.get("shards", []))
            file.write("\n]}\n")
        os.replace(part, name)
    finally:
        if os.path.exists(part):
            os.unlink(part)
    return counts


def plan_takes(
    found: Iterable[tuple[str, str]],
    options: dict[str, Any],
    shard_frames: int,
    ordered_map: Callable[[Iterable[dict[str, Any]]], Iterator[dict[str, Any]]],
) -> Iterator[Take]:
    """Plan takes with an engine, in their order.

    Args:
        found: Name and path of each take.
        options: Options of all takes: see :func:`plan_take`.
        shard_frames: Frames of a shard.
        ordered_map: Function that runs tasks and returns their results in order.
    """

    def jobs() -> Iterator[dict[str, Any]]:
        for name, source in found:
            yield {
                "task": "plan",
                "name": name,
                "source": source,
                "options": options,
                "shard_frames": shard_frames,
            }

    for result in ordered_map(jobs()):
        yield result["take"] if result["ok"] else {**result["of"], "error": result["error"]}
