"""Jobs on files: measuring, describing, repairing, joining and cutting."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from . import _isv
from ._checks import frames_of, number_of, place_of, progress_of, whole_of
from ._encode import EncodeOptions
from ._options import options_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = [
    "Repaired",
    "cut",
    "demux",
    "draw",
    "evaluate",
    "info",
    "join",
    "mux",
    "repair",
    "set_threads",
    "settle",
    "verify",
]

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
    test_frames: slice | range | tuple[int, int] | None = None,
    units: Literal["m", "dm", "cm", "mm", "in", "ft", "us-ft"] = "m",
    test_units: Literal["m", "dm", "cm", "mm", "in", "ft", "us-ft"] = "m",
    origin: Sequence[float] | None = None,
    test_origin: Sequence[float] | None = None,
    up: Literal["y", "z", "x", "-y", "-z", "-x"] = "y",
    test_up: Literal["y", "z", "x", "-y", "-z", "-x"] = "y",
    animation: str | None = None,
    test_animation: str | None = None,
    fps: float = 30.0,
    progress: Callable[[int, int | None], object] | None = None,
) -> dict[str, Any]:
    """Measure the errors of frames against a reference: of their geometry and of their colours.

    Args:
        reference: A folder or pattern of meshes or points, one file, or a stream.
        test: What is measured, of the same kinds.
        spacing: Edge of the square of surface that each sample stands for (m).
        frames: Frames of the reference, counted from 0 [default: all].
        test_frames: As many frames of what is measured [default: the same ones, or all if there are just as many].
        units: Unit of the reference. Streams know theirs.
        test_units: Unit of what is measured.
        origin: Place (x, y, z) of meshes or points of the reference, in its unit, that is the origin of the other side.
        test_origin: Place (x, y, z) of meshes or points that are measured, in their unit, that is the origin.
        up: Axis of the reference that points up.
        test_up: Axis of what is measured that points up.
        animation: Animation of a reference in glTF, by name or number from 0 [default: the first that moves anything].
        test_animation: Animation of what is measured, as ``animation``.
        fps: Frames a second at which animations are sampled.
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
        paths[0],
        paths[1],
        number_of("spacing", spacing, "metres"),
        frames_of(frames),
        frames_of(test_frames, "test_frames"),
        [units, test_units],
        [_place("origin", origin), _place("test_origin", test_origin)],
        [up, test_up],
        [animation, test_animation],
        number_of("fps", fps, "frames a second"),
        progress,
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


def mux(path: _Path, output: _Path, *, sound: _Path | None = None) -> int:
    """Put a stream into an MP4 file, with sound beside it. Nothing is coded anew but waveforms.

    Args:
        path: The stream, an ``.isv`` or MP4 file. Tracks beside its stream stay.
        output: The MP4 file to write, which is another file.
        sound: An MP4, MP3, Ogg (Opus), FLAC or WAV file. WAV is coded with Opus, at 128 kbps.

    Returns:
        The number of frames.

    Raises:
        OSError: A file is not there.
        IsvError: A file cannot be read (kind "input" or "stream"), or the output cannot be written (kind "output").
    """
    return _isv.mux(_there(path), os.fspath(output), None if sound is None else _there(sound))


def demux(path: _Path, output: _Path) -> None:
    """Take the stream out of an MP4 file, byte for byte.

    Args:
        path: The MP4 file.
        output: The stream to write, which is another file.

    Raises:
        OSError: The file is not there.
        IsvError: It is no MP4 file with a stream (kind "stream"), or the output cannot be written (kind "output").
    """
    _isv.demux(_there(path), os.fspath(output))


def join(paths: Sequence[_Path], output: _Path, *, keep_times: bool = False) -> int:
    """Put streams one after the other, without coding anything anew. They have one profile, grid and frame rate.

    Args:
        paths: The streams, in order, at least one.
        output: The stream to write, which is another file.
        keep_times: Keep the times of all packets, as parts of a take have them that were encoded with ``time_origin``
            [default: each stream follows the one before at the frame rate].

    Returns:
        The number of frames.

    Raises:
        OSError: A file is not there.
        ValueError: There are no streams.
        IsvError: They do not go together (kind "stream"), or the output cannot be written (kind "output").
    """
    if isinstance(paths, (str, bytes, os.PathLike)):
        raise TypeError("paths is a list of paths, not one path")
    return _isv.join([_there(path) for path in paths], os.fspath(output), bool(keep_times))


def settle(
    source: _Path,
    *,
    every: int = 300,
    frames: slice | range | tuple[int, int] | None = None,
    **options: Unpack[EncodeOptions],
) -> dict[str, Any]:
    """Decide what options leave open of a take, as encoding it would, for parts of it that are encoded apart.

    Args:
        source: A path of what ``isv encode`` takes.
        every: Number of frames after which the shape of a mesh is looked at again. A take with an open part in any of
            the frames looked at is one of sheets.
        frames: Frames of the source to encode, counted from 0 [default: all].
        options: See :class:`EncodeOptions`.

    Returns:
        ``frames`` (the first and the one behind the last), ``fps``, ``voxel`` (m), ``block`` and ``truncation``
        (voxels), ``profile``, ``color``, ``content``, ``sign`` (None without meshes), ``quality`` (None unless it goes
        with ``voxel="auto"``) and ``frames_stand_alone``.

    Raises:
        OSError: The source is not there.
        ValueError: An option has a value that it cannot have.
        IsvError: The take cannot be encoded with these options; its ``kind`` says what can be done about it.
    """
    given = options_of(options)
    if (wanted := frames_of(frames)) is not None:
        given["frames"] = wanted
    decided: dict[str, Any] = json.loads(_isv.settle_options(_there(source), given, int(every)))
    return decided


def verify(path: _Path) -> tuple[int, int]:
    """Decode a whole stream and check it: checksums of packets, hashes of frames, index and end.

    Returns:
        The number of frames, and of those that state a hash.

    Raises:
        OSError: The file is not there.
        IsvError: Something is wrong with the stream (kind "stream").
    """
    return _isv.verify(_there(path))


def draw(
    path: _Path,
    output: _Path,
    frames: Sequence[int],
    *,
    size: int = 384,
    columns: int | None = None,
    against: _Path | None = None,
    against_first: int = 0,
    units: Literal["m", "dm", "cm", "mm", "in", "ft", "us-ft"] = "m",
    origin: Sequence[float] | None = None,
    up: Literal["y", "z", "x", "-y", "-z", "-x"] = "y",
    animation: str | None = None,
    fps: float = 30.0,
    error_range: float = 0.002,
) -> None:
    """Draw frames of a stream, or of a capture in metres, into one PNG file.

    Args:
        path: The stream or capture.
        output: The picture to write: a contact sheet of several frames.
        frames: Numbers of the frames.
        size: Edge of each drawing (pixels).
        columns: Columns of the contact sheet [default: about as many as rows].
        against: A capture of meshes, or a stream. Surfaces are coloured by their distance to it [default: by their own
            colours, or by their normals].
        against_first: Frame of ``against`` that belongs to frame 0.
        units: Unit of ``against``.
        origin: Place (x, y, z) of ``against``, in its unit, that is the origin.
        up: Axis of ``against`` that points up.
        animation: Animation of ``against`` in glTF, by name or number from 0 [default: the first that moves anything].
        fps: Frames a second at which it is sampled.
        error_range: Distance at which the colours of errors end (m).

    Raises:
        OSError: A file is not there.
        ValueError: A frame, a size or a length cannot be.
        IsvError: A frame cannot be read or has no surface (kind "input"), or the picture would replace what it is of.
    """
    reference = None
    if against is not None:
        place, rate = _place("origin", origin), number_of("fps", fps, "frames a second")
        reference = (_there(against), units, place, up, int(against_first), animation, rate)
    numbers = [int(number) for number in frames]
    _isv.draw(
        _there(path),
        os.fspath(output),
        numbers,
        int(size),
        columns,
        reference,
        number_of("error_range", error_range, "metres"),
    )


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
    if threads is not None:
        threads = whole_of("threads", threads, 1, 1024)
    _isv.set_threads(threads)


def _place(name: str, place: Sequence[float] | None) -> tuple[float, float, float] | None:
    return None if place is None else place_of(name, place)


def _there(path: _Path) -> str:
    name = os.fspath(path)
    if not any(mark in os.path.basename(name) for mark in "*?["):
        # What is not there is said as everywhere in Python.
        os.stat(name)
    return name
