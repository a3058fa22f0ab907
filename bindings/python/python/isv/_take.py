"""Streams to frames."""

from __future__ import annotations

import builtins
import io
import operator
import os
import stat
from collections.abc import Iterator
from types import TracebackType
from typing import Any, Literal, Protocol, TypeAlias, overload, runtime_checkable

from . import _isv
from ._checks import bytes_of
from ._data import Mesh, Points, Volume

__all__ = ["Frame", "Source", "SurfaceParts", "Take", "open"]


@runtime_checkable
class _Readable(Protocol):
    def read(self, size: int, /) -> bytes: ...


@runtime_checkable
class _Receiving(Protocol):
    def recv(self, size: int, /) -> bytes: ...


Source: TypeAlias = str | os.PathLike[str] | bytes | bytearray | memoryview | _Readable | _Receiving
"""Input of a stream: a path, its bytes, a binary file, or a connected socket."""

_LEVELS = (1, 2, 4)


class Frame:
    """A decoded frame. Its surface, points and field are made when they are asked for.

    Frames are made by :class:`Take`. They stay valid when it is closed.
    """

    __slots__ = ("_native",)

    def __init__(self, native: _isv.Frame) -> None:
        self._native = native

    @property
    def number(self) -> int:
        """Number in the stream, from 0."""
        return self._native.number

    @property
    def timestamp(self) -> float:
        """Time at which the frame is shown (s), from the stream's start or, in a live stream, from 1970."""
        return self._native.timestamp_ns / 1e9

    @property
    def timestamp_ns(self) -> int:
        """Time at which the frame is shown (ns), exactly."""
        return self._native.timestamp_ns

    def mesh(self, *, normals: bool = False) -> Mesh:
        """Extract the surface.

        Args:
            normals: Whether vertices get unit normals, which takes longer.

        Returns:
            The mesh: vertices float32 (V, 3) in metres, faces uint32 (F, 3), normals float32 (V, 3) or None, colors
            uint8 (V, 3) or None where the stream has no colour. The values are those of ``isv decode``, bit for bit.

        Raises:
            IsvError: There is no memory for the surface (kind "memory").
        """
        return Mesh(*self._native.mesh(normals))

    def points(self, count: int | None = None) -> Points:
        """Spread points evenly over the surface.

        Args:
            count: Number of points, at least 1. Without it, each point stands for a square of a voxel's edge.

        Returns:
            The points: positions float32 (N, 3) in metres, normals float32 (N, 3), colors uint8 (N, 3) or None. A frame
            without surface has none. The values are those of ``isv decode --as points``, bit for bit.

        Raises:
            ValueError: The count is below 1.
            IsvError: There is no memory for the surface or the points (kind "memory").
        """
        if count is not None and count < 1:
            raise ValueError(f"count is {count}: a frame has at least 1 point")
        positions, normals, colors = self._native.points(count)
        return Points(positions, normals, colors)

    def volume(self) -> Volume:
        """Return the field of signed distances.

        Returns:
            The field: distances float32 (B, edge, edge, edge) in metres with axes (block, z, y, x), NaN where nothing
            was observed, and coords int32 (B, 3). Streams keep distances near the surface; others are extrapolated.

        Raises:
            IsvError: There is no memory for the field (kind "memory").
        """
        voxel, _, truncation, coords, distances = self._native.volume()
        return Volume(voxel, coords, distances, truncation)

    def to_trimesh(self) -> Any:
        """Extract the surface as a ``trimesh.Trimesh``, with colours if the stream has any.

        Raises:
            ImportError: trimesh is not installed.
            IsvError: There is no memory for the surface (kind "memory").
        """
        return self.mesh().to_trimesh()

    def to_open3d(self) -> Any:
        """Extract the surface as an ``open3d.geometry.TriangleMesh`` with normals, and with colours if there are any.

        Raises:
            ImportError: open3d is not installed.
            IsvError: There is no memory for the surface (kind "memory").
        """
        return self.mesh(normals=True).to_open3d()

    def __repr__(self) -> str:
        return f"<isv.Frame {self.number} at {self.timestamp:.3f} s>"


_Place: TypeAlias = tuple[int, int, int]


class SurfaceParts:
    """The surface of one frame after another in parts, of which those are extracted again that changed.

    A part is what 4x4x4 blocks hold. Its mesh stands alone: vertices at the border of two parts are in
    both. In a scene of which little moves, :meth:`update` costs what moves, and a viewer keeps the meshes of all other
    parts. ``for place in parts`` gives the places of all parts, ``parts[place]`` the mesh of one.
    """

    __slots__ = ("_frame", "_native", "_normals")

    def __init__(self, *, normals: bool = False) -> None:
        """Make the surface of nothing.

        Args:
            normals: Whether vertices get unit normals, which takes longer.
        """
        self._native = _isv.SurfaceParts(normals)
        self._normals = normals
        self._frame: _isv.Frame | None = None

    def update(self, frame: Frame) -> tuple[list[_Place], list[_Place]]:
        """Take the surface of a frame in place of the last one.

        Returns:
            The places of parts that are new or were extracted again, and of those that are gone. A place is the part's
            block with the lowest coordinates (x, y, z), in blocks.

        Raises:
            IsvError: There is no memory for the surface (kind "memory"). The parts are what they were.
        """
        changes = self._native.update(frame._native)
        self._frame = frame._native
        return changes

    def __getitem__(self, place: _Place) -> Mesh:
        """Return the mesh of a part, as :meth:`Frame.mesh` does, with the colours of the last frame.

        Raises:
            KeyError: There is no part at this place.
        """
        mesh = None if self._frame is None else self._native.mesh(place, self._frame, self._normals)
        if mesh is None:
            raise KeyError(place)
        return Mesh(*mesh)

    def __iter__(self) -> Iterator[_Place]:
        """Iterate over the places of all parts."""
        return iter(self._native.places())

    def __len__(self) -> int:
        """Number of parts."""
        return len(self._native.places())

    def __repr__(self) -> str:
        return f"<isv.SurfaceParts, {len(self)} parts>"


class Take:
    """A stream that is open for reading: a sequence of frames. Made by :func:`open`.

    ``take[37]`` decodes a frame, from the keyframe before it or on from the frame that was decoded last, whichever is
    nearer. ``for frame in take`` decodes all frames in order. Several threads may use one take; one of them decodes at
    a time, without the GIL.

    Takes of paths and bytes can be pickled, and used in a process that was forked: there they are opened anew.
    """

    def __init__(
        self,
        source: Source,
        *,
        lod: Literal[1, 2, 4] = 1,
        after_loss: Literal["stop", "hold"] = "stop",
        color: bool = True,
        memory_limit: int | None = None,
    ) -> None:
        if lod not in _LEVELS:
            raise ValueError(f"lod is 1, 2 or 4, not {lod!r}")
        if after_loss not in ("stop", "hold"):
            raise ValueError(f'after_loss is "stop" or "hold", not {after_loss!r}')
        if memory_limit is not None:
            memory_limit = bytes_of("memory_limit", memory_limit)
        if isinstance(source, (str, os.PathLike)):
            # An absolute path is the same file in another process.
            source = os.path.abspath(os.fspath(source))
        elif isinstance(source, (bytearray, memoryview)):
            source = bytes(source)
        self._source = source
        self._settings = (int(lod), after_loss == "hold", bool(color), memory_limit)
        self._reader: _isv.Reader | None = _open(source, self._settings)
        self._process = os.getpid()

    @property
    def _native(self) -> _isv.Reader:
        if self._reader is None:
            raise ValueError("the take is closed")
        if self._process != os.getpid():
            # A child shares places in files with its parent, and has none of its threads.
            self._reader = _open(_reopenable(self._source, "used in a forked process"), self._settings)
            self._process = os.getpid()
        return self._reader

    @property
    def fps(self) -> float | None:
        """Frames a second; None for a live stream before its first frame."""
        return self._native.fps

    @property
    def voxel(self) -> float | None:
        """Edge of a voxel at full resolution (m); None for a live stream before its first frame."""
        return self._native.voxel

    @property
    def live(self) -> bool:
        """Whether bytes come once, so that frames come in order and nobody knows how many."""
        return self._native.frames is None

    def __len__(self) -> int:
        """Number of frames. Those that are lost do not count, also where the last one is held in their place.

        Raises:
            TypeError: The stream is live.
        """
        frames = self._native.frames
        if frames is None:
            raise TypeError("a live stream has no length")
        return frames

    @overload
    def __getitem__(self, number: int) -> Frame: ...
    @overload
    def __getitem__(self, number: slice) -> list[Frame]: ...
    def __getitem__(self, number: int | slice) -> Frame | list[Frame]:
        """Decode a frame by its number, from 0, or from the end where it is negative; or the frames of a slice.

        Raises:
            IndexError: There is no such frame.
            TypeError: The stream is live.
            IsvError: The stream is damaged or cut (kind "stream").
        """
        frames = len(self)
        if isinstance(number, slice):
            return [self[frame] for frame in range(*number.indices(frames))]
        asked = operator.index(number)
        if -frames <= asked < frames:
            return Frame(self._native.frame(asked % frames))
        # Frames that are held in place of lost ones are not among those that are counted.
        holds = self._settings[1]
        held = self._native.frame_from(asked) if holds and 0 <= asked < 2**32 else None
        if held is None or held.number != asked:
            raise IndexError(f"frame {asked} asked for, but there are {frames}")
        return Frame(held)

    def __iter__(self) -> Iterator[Frame]:
        """Decode all frames in order; of a live stream those that come from now on.

        Raises:
            IsvError: The stream is damaged or cut (kind "stream"). Frames before it came first.
        """
        holds = self._settings[1]
        if not self.live and not holds:
            for number in range(len(self)):
                yield Frame(self._native.frame(number))
            self._native.read_end()
            return
        number = 0
        while (frame := self._native.next_frame() if self.live else self._native.frame_from(number)) is not None:
            number = frame.number + 1
            yield Frame(frame)

    def close(self) -> None:
        """Close the stream. Files and sockets that it was given stay open."""
        self._reader = None

    @property
    def closed(self) -> bool:
        """Whether the take is closed."""
        return self._reader is None

    def __enter__(self) -> Take:
        if self._reader is None:
            raise ValueError("the take is closed")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        source = _reopenable(self._source, "pickled")
        return {"source": source, "settings": self._settings, "closed": self.closed}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._source, self._settings = state["source"], state["settings"]
        self._reader = None if state["closed"] else _open(self._source, self._settings)
        self._process = os.getpid()

    def __repr__(self) -> str:
        name = _name(self._source)
        if self._reader is None:
            return f"<isv.Take of {name}, closed>"
        return f"<isv.Take of {name}, {'live' if self.live else f'{len(self)} frames'}>"


def open(
    source: Source,
    *,
    lod: Literal[1, 2, 4] = 1,
    after_loss: Literal["stop", "hold"] = "stop",
    color: bool = True,
    memory_limit: int | None = None,
) -> Take:
    """Open a stream.

    Args:
        source: A path, the bytes of a stream, a binary file, or a connected socket. A file that can be sought in gives
            any frame; other files and sockets are live: their frames come in order.
        lod: Level of detail: 2 and 4 decode at half and a quarter of the resolution.
        after_loss: What to do where packets are damaged or missing: "stop" raises, "hold" gives the last frame in place
            of each lost one and goes on where that can be.
        color: Whether colour is decoded, where the stream has any.
        memory_limit: Memory for a frame (bytes). Without it a frame has 3 billion voxels at most, and no more than the
            stream's bytes make likely.

    Returns:
        The take, which closes itself at the end of a ``with`` block.

    Raises:
        OSError: The file cannot be opened, such as FileNotFoundError.
        TypeError: The source is none of these.
        ValueError: An option has a value that it cannot have.
        IsvError: The bytes are no stream, or one of a newer version (kind "stream").
    """
    return Take(source, lod=lod, after_loss=after_loss, color=color, memory_limit=memory_limit)


def _open(source: Source, settings: tuple[int, bool, bool, int | None]) -> _isv.Reader:
    if isinstance(source, str):
        # What cannot be opened is said as everywhere in Python. A pipe has its bytes once.
        if not stat.S_ISFIFO(os.stat(source).st_mode):
            builtins.open(source, "rb").close()
        return _isv.Reader.open(source, settings)
    if isinstance(source, bytes):
        return _isv.Reader.from_bytes("bytes", source, settings)
    if isinstance(source, io.TextIOBase):
        raise TypeError("a stream is read from a binary file: open it with mode 'rb'")
    if isinstance(source, (_Readable, _Receiving)):
        return _isv.Reader.from_file(_name(source), source, _seekable(source), settings)
    raise TypeError(f"a stream is a path, bytes, a binary file or a socket, not {type(source).__name__}")


def _seekable(source: object) -> bool:
    seekable = getattr(source, "seekable", None)
    return bool(seekable()) if callable(seekable) else False


def _reopenable(source: Source, use: str) -> str | bytes:
    if isinstance(source, (str, bytes)):
        return source
    raise TypeError(f"a take of an open file or socket cannot be {use}: open it by its path there")


def _name(source: object) -> str:
    if isinstance(source, str):
        return source
    if isinstance(source, bytes):
        return f"{len(source)} bytes"
    name = getattr(source, "name", None)
    return name if isinstance(name, str) else type(source).__name__
