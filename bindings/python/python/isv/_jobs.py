"""Jobs on files: measuring, describing, repairing, joining and cutting."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from . import _isv
from ._checks import frames_of, progress_of

__all__ = ["Repaired", "cut", "evaluate", "info", "join", "repair", "set_threads"]

_Path: TypeAlias = str | os.PathLike[str]


@dataclass(frozen=True)
class Repaired:
    """Result of a repair.

    Attributes:
        kept: Frames kept.
        orphaned: Sound frames left out, as they cannot be decoded without a lost one.
        doubled: Frames left out, as they were there twice in a row.
        damage: Places that are damaged: the first byte and the number of bytes of each.
        had_end: Whether index and trailer were there and sound.
    """

    kept: int
    orphaned: int
    doubled: int
    damage: list[tuple[int, int]]
    had_end: bool


def evaluate(
    reference: _Path,
    test: _Path,
    *,
    spacing: float = 0.005,
    frames: slice | range | tuple[int, int] | None = None,
    units: Literal["m", "dm", "cm", "mm", "in", "ft", "us-ft"] = "m",
    test_units: Literal["m", "dm", "cm", "mm", "in", "ft", "us-ft"] = "m",
    up: Literal["y", "z", "x", "-y", "-z", "-x"] = "y",
    test_up: Literal["y", "z", "x", "-y", "-z", "-x"] = "y",
    progress: Callable[[int, int | None], object] | None = None,
) -> dict[str, Any]:
    """Measure the errors of frames against a reference: of their geometry and of their colours.

    Args:
        reference: A folder or pattern of meshes or points, one file, or a stream.
        test: What is measured, of the same kinds.
        spacing: Edge of the square of surface that each sample stands for (m).
        frames: Frames of the reference, counted from 0 [default: all].
        units: Unit of the reference. Streams know theirs.
        test_units: Unit of what is measured.
        up: Axis of the reference that points up.
        test_up: Axis of what is measured that points up.
        progress: Function that is called with the number of frames done, and None.

    Returns:
        What ``isv eval --json`` prints: the figures of the mean, and ``frames``, a list with those of each frame.

    Raises:
        OSError: The reference or the test is not there.
        ValueError: The spacing, the frames, a unit or an axis cannot be.
        IsvError: Something cannot be read or compared (kind "input").
    """
    paths = [_there(path) for path in (reference, test)]
    progress = progress_of(progress)
    json_text = _isv.evaluate(
        paths[0], paths[1], float(spacing), frames_of(frames), [units, test_units], [up, test_up], progress
    )
    figures: dict[str, Any] = json.loads(json_text)
    return figures


def info(path: _Path) -> dict[str, Any]:
    """Describe a stream.

    Returns:
        What ``isv info --json`` prints: ``frames``, ``fps``, ``voxel_size_m``, ``bytes``, ``keyframes``, ``packets``
        and more. Frames are not decoded.

    Raises:
        OSError: The file is not there.
        IsvError: The file is no stream, or a damaged one (kind "stream").
    """
    facts: dict[str, Any] = json.loads(_isv.info(_there(path)))
    return facts


def repair(path: _Path, output: _Path, *, header_from: _Path | None = None) -> Repaired:
    """Make a stream of what is sound in a damaged, cut or unfinished one. Packets are kept byte for byte.

    Args:
        path: The stream.
        output: The stream to write, which is another file.
        header_from: A stream of the same take, whose header stands for a damaged one.

    Raises:
        OSError: A file is not there.
        IsvError: No frame can be decoded (kind "stream"), or the output cannot be written (kind "output").
    """
    other = None if header_from is None else _there(header_from)
    return Repaired(*_isv.repair(_there(path), os.fspath(output), other))


def join(paths: Sequence[_Path], output: _Path) -> int:
    """Put streams one after the other, without coding anything anew. They have one profile, grid and frame rate.

    Args:
        paths: The streams, in order, at least one.
        output: The stream to write, which is another file.

    Returns:
        The number of frames.

    Raises:
        OSError: A file is not there.
        ValueError: There are no streams.
        IsvError: They do not go together (kind "stream"), or the output cannot be written (kind "output").
    """
    if isinstance(paths, (str, bytes, os.PathLike)):
        raise TypeError("paths is a list of paths, not one path")
    return _isv.join([_there(path) for path in paths], os.fspath(output))


def cut(path: _Path, output: _Path, frames: slice | range | tuple[int, int]) -> int:
    """Copy frames of a stream into one of its own, without coding anything anew.

    Args:
        path: The stream.
        output: The stream to write, which is another file.
        frames: Frames, counted from 0, as ``slice(30, 60)``. The first of them is a keyframe.

    Returns:
        The number of frames.

    Raises:
        OSError: The file is not there.
        ValueError: There are no such frames.
        IsvError: The first frame is no keyframe (kind "stream"), or the output cannot be written (kind "output").
    """
    wanted = frames_of(frames)
    return _isv.cut(_there(path), os.fspath(output), wanted or (0, None))


def set_threads(threads: int | None) -> None:
    """Choose the number of threads of this process.

    Args:
        threads: At least 1, or None for one a processor, which is the default, or ``RAYON_NUM_THREADS`` if that is set.
            Workers of a ``DataLoader`` are best with 1 each.

    Raises:
        ValueError: The number is below 1 or above 1024.
    """
    if threads is not None and not 1 <= threads <= 1024:
        raise ValueError(f"threads is {threads}: a number from 1 to 1024")
    _isv.set_threads(threads)


def _there(path: _Path) -> str:
    name = os.fspath(path)
    if not any(mark in os.path.basename(name) for mark in "*?["):
        # What is not there is said as everywhere in Python.
        os.stat(name)
    return name
