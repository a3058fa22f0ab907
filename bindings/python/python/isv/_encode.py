"""Frames to streams."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Sequence, Sized
from dataclasses import dataclass, replace
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias, TypedDict, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from . import _isv
from ._checks import depth_of, frames_of, number_of, numbers_of, progress_of, shown
from ._data import Camera, ColorImage, DepthImage, Mesh, Points, Volume, mesh_of, points_of
from ._options import options_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["EncodeOptions", "Report", "Sink", "Writer", "encode"]


@runtime_checkable
class _Writable(Protocol):
    def write(self, data: bytes, /) -> Any: ...


@runtime_checkable
class _Sending(Protocol):
    def sendall(self, data: bytes, /) -> Any: ...


Sink: TypeAlias = str | os.PathLike[str] | _Writable | _Sending
"""Output of a stream: a path, a binary file, or a connected socket."""


class EncodeOptions(TypedDict, total=False):
    """Options of encoding. What is not given is decided by the frames, or has the default of ``isv encode``."""

    quality: float
    """Quality, 0 to 100, the same in all frames [default: 50]. Excludes ``bitrate_mbps`` and ``max_error``."""
    bitrate_mbps: float
    """Bit rate of geometry and colour (millions of bits a second), every byte counted."""
    max_error: float
    """RMS surface error that every frame stays below (m)."""
    two_passes: bool
    """Meet the bit rate by one step for all frames. Sources that are paths alone."""
    voxel: float | Literal["auto"]
    """Edge of a voxel (m) [default: what fits, 5 mm for meshes]. "auto" tries a few: sources that are paths alone."""
    fps: float
    """Frames a second, to a thousandth [default: the source's, else 30]."""
    gop: int
    """Most frames from a keyframe to the next [default: 30]."""
    fixed_gop: bool
    """Code every ``gop`` frames by themselves: a group has the same bytes, however many groups are coded at once."""
    time_origin: int
    """Frame at which the stream's time begins [default: the first of ``frames``]. Sources that are paths."""
    preset: Literal["realtime", "balanced", "archive"]
    """Work to take on [default: "balanced"]."""
    refresh: Literal["keyframes", "gradual"]
    """How decoders recover from lost packets [default: "keyframes"]."""
    color: bool
    """Whether colour is coded, where frames have any [default: True]."""
    expect_color: bool
    """Make room for colour though the first frame has none, as streams are to be joined."""
    color_quality: float
    """Quality of colour, 0 to 100 [default: 50, or what a bit rate gives]."""
    profile: Literal["main", "paper"]
    """Set of the codec's tools; "paper" is for comparisons [default: "main"]."""
    full_band: bool
    """Keep the whole band of distances, by profile "paper"."""
    checksums: bool
    """Put a hash of each decoded frame into the stream."""
    title: str
    """Title of the take, for people; ``isv.info`` has it under "metadata"."""
    capture_device: str
    """What captured the take, for people."""
    metadata: Literal["auto", "always", "never"]
    """Whether the stream says what it is [default: "auto", where it has colour, a title or a capture device]."""
    timestamps: Literal["source", "rate", "clock"]
    """What packets are stamped with [default: "source"]."""
    sign: Literal["auto", "closed", "offset", "sheet"]
    """How to tell inside from outside of meshes and points [default: "auto"]."""
    shell_offset: float
    """Half the thickness of the shell around a surface without inside (voxels) [default: 1.5]."""
    estimate_normals: bool
    """Estimate the normals of points."""
    viewpoint: Sequence[float]
    """Place (x, y, z) that points were seen from, in the source's unit and coordinates."""
    accumulate_depth: bool
    """Take a frame of depth images for all that was seen so far: the camera moves and the scene stands still."""
    max_depth: float
    """Leave out what depth cameras saw farther away (m)."""
    max_blocks: int
    """Refuse frames that need more blocks."""
    units: Literal["m", "dm", "cm", "mm", "in", "ft", "us-ft"]
    """Unit of the coordinates of meshes and points [default: "m"]."""
    origin: Sequence[float]
    """Place (x, y, z) of meshes and points, in their unit, that becomes the origin."""
    up: Literal["y", "z", "x", "-y", "-z", "-x"]
    """Axis of meshes and points that points up [default: "y"]."""
    animation: str
    """Animation of a glTF file, by name or number from 0 [default: the first that moves anything]."""
    skip_bad_frames: bool
    """Leave out frames that cannot be read or used. Sources that are paths keep the times of the others."""
    drop_invalid_points: bool
    """Leave out points that are not finite or lie at exactly (0, 0, 0), as cameras write "no reading"."""
    memory_limit: int
    """Memory for a frame (bytes) that decoders are known to have. Frames that need more are refused."""


@dataclass(frozen=True)
class Report:
    """What became of a take.

    Attributes:
        frames: Frames in the stream.
        empty: Frames without a surface.
        skipped: Frames that were left out.
        bytes: Size of the stream.
        duration: Time that the stream takes to show (s).
        voxel: Edge of a voxel (m).
        shell: Thickness of the shell around surfaces without inside (m), or None if none was made.
    """

    frames: int
    empty: int
    skipped: int
    bytes: int
    duration: float
    voxel: float
    shell: float | None

    @property
    def mbps(self) -> float:
        """Mean rate (millions of bits a second); 0 for a stream that takes no time."""
        return self.bytes * 8 / self.duration / 1e6 if self.duration > 0 else 0.0


class Writer:
    """A stream that frames are written to one by one.

    ``with isv.Writer("take.isv", voxel=0.005) as writer: writer.push((vertices, faces))``. All frames of a stream are
    of one kind. The file has its name once :meth:`close` was called, or the ``with`` block ended without an exception.
    Sockets and files get each frame at once.
    """

    def __init__(self, output: Sink, **options: Unpack[EncodeOptions]) -> None:
        """Make a stream.

        Args:
            output: A path, a binary file, or a connected socket. A stream at the path is replaced, nothing else is.
            options: See :class:`EncodeOptions`.

        Raises:
            TypeError: There is no such option, it is of another type, or the output is none of these.
            ValueError: An option has a value that it cannot have, or two exclude each other.
            IsvError: The options do not go together (kind "options"), or the file cannot be made (kind "output").
        """
        given = options_of(options)
        self._drops = bool(given.get("drop_invalid_points"))
        self._skips = bool(given.get("skip_bad_frames"))
        self._native = _isv.Writer(_sink(output), given)
        self._skipped = 0
        self._closed = False
        self._report: Report | None = None

    @property
    def report(self) -> Report | None:
        """What became of the take, once the writer was closed."""
        return self._report

    def push(self, frame: Any, *, time: float | None = None) -> None:
        """Encode a frame.

        Args:
            frame: One of: :class:`Mesh`, ``(vertices, faces)`` or ``(vertices, faces, colors)``, a ``trimesh.Trimesh``
                or ``trimesh.PointCloud``, an ``open3d`` mesh or point cloud of either API, :class:`Points`, an array
                of positions (N, 3) as floats, :class:`DepthImage` or a list of these and of :class:`ColorImage`,
                :class:`Volume`.
            time: Time at which it was taken (s), from any start. Later frames have later times.

        Raises:
            TypeError: The frame is none of these, or an array has another dtype.
            ValueError: An array has another shape, numbers that are not finite, or faces without vertices; the time is
                negative; the writer is closed.
            IsvError: The frame cannot be used (kind "frame"), or there is no memory for it (kind "memory").
        """
        if time is not None and not 0 <= (time := number_of("time", time, "seconds from 0 on")) < 1e10:
            raise ValueError(f"time is {time}: seconds from 0 on")
        if self._closed:
            raise ValueError("the writer is closed")
        try:
            self._push(frame_of(frame, drop_invalid=self._drops), time)
        except ValueError as error:
            if not (self._skips and getattr(error, "kind", "frame") == "frame"):
                raise
            self._skipped += 1

    def _push(self, frame: AnyFrame, time: float | None) -> None:
        native = self._native
        time_ns = None if time is None else round(time * 1e9)
        match frame:
            case Mesh():
                native.push_mesh(frame.vertices, frame.faces, frame.colors, time_ns)
            case Points():
                native.push_points(frame.positions, frame.normals, frame.colors, frame.viewpoint, time_ns)
            case Volume():
                native.push_volume(frame.voxel, frame.truncation, frame.coords, frame.distances, time_ns)
            case list():
                depths = [image for image in frame if isinstance(image, DepthImage)]
                colors = [image for image in frame if isinstance(image, ColorImage)]
                native.push_depth(
                    [(image.depth, _camera(image.camera)) for image in depths],
                    [(image.color, _camera(image.camera), image.depth_image) for image in colors],
                    time_ns,
                )

    def close(self) -> Report:
        """Complete the stream and give its file its name.

        Returns:
            What became of the take; the same again if it was closed before.

        Raises:
            IsvError: The stream cannot be written (kind "output"), or could not before.
        """
        self._closed = True
        if self._report is None:
            report = Report(*self._native.finish())
            self._report = replace(report, skipped=report.skipped + self._skipped)
        return self._report

    def __enter__(self) -> Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._closed = True
            self._native.abandon()


def encode(
    source: Any,
    output: Sink,
    *,
    frames: slice | range | tuple[int, int] | None = None,
    progress: Callable[[int, int | None], object] | None = None,
    **options: Unpack[EncodeOptions],
) -> Report:
    """Encode a take.

    Args:
        source: A path of what ``isv encode`` takes: a folder of frames, a pattern such as ``take/*.obj``, one file, a
            folder of depth images and calibration, of volumes, or an ``.isv`` file. Or any iterable of frames as
            :meth:`Writer.push` takes them.
        output: A path, a binary file, or a connected socket. A stream at the path is replaced, nothing else is.
        frames: Frames of the source to encode, counted from 0, as ``slice(10, 20)`` [default: all].
        progress: Function that is called with the number of frames done and of all frames (None if nobody knows), after
            each frame. What it raises ends the job.
        options: See :class:`EncodeOptions`.

    Returns:
        What became of the take.

    Raises:
        OSError: The source is not there.
        TypeError: The source, a frame or an option is of another type.
        ValueError: An option or an array has a value that it cannot have, or the source has no frames.
        IsvError: The job failed; its ``kind`` says what can be done about it.

    A job that ends with an exception, such as KeyboardInterrupt, leaves nothing of its output, and a file that was
    there stays what it was.
    """
    progress = progress_of(progress)
    wanted = frames_of(frames)
    if isinstance(source, (str, os.PathLike)):
        given = options_of(options)
        if wanted is not None:
            given["frames"] = wanted
        path = os.fspath(source)
        if not any(mark in os.path.basename(path) for mark in "*?["):
            # What is not there is said as everywhere in Python.
            os.stat(path)
        return Report(*_isv.encode(path, _sink(output), given, progress))
    if isinstance(source, (Mesh, Points, Volume, DepthImage, np.ndarray)):
        raise TypeError(f"a source is an iterable of frames: put the {type(source).__name__} into a list")
    if isinstance(source, (bytes, bytearray)) or not isinstance(source, Iterable):
        raise TypeError(f"a source is a path or an iterable of frames, not {type(source).__name__}")
    total = len(source) if isinstance(source, Sized) else None
    start, stop = wanted or (0, None)
    if total is not None:
        total = max(0, min(total, total if stop is None else stop) - start)
    with Writer(output, **options) as writer:
        done = 0
        for number, frame in enumerate(source):
            if number < start:
                continue
            if stop is not None and number >= stop:
                break
            try:
                writer.push(frame)
            except (TypeError, ValueError) as error:
                if sys.version_info >= (3, 11):
                    error.add_note(f"This is frame {number} of the source.")
                raise
            done += 1
            if progress is not None:
                progress(done, total)
        if writer._skipped == done:
            # The exception keeps what is at the output now.
            why = f"no frame could be used, {done} skipped" if done else "there are no frames"
            raise ValueError(f"the source: {why}" + ("" if wanted is None else f" ({_told(wanted)})"))
    report = writer.report
    assert report is not None
    return report


def _told(frames: tuple[int, int | None]) -> str:
    start, stop = frames
    return f"frames from {start} on" if stop is None else f"frames {start} to {stop - 1}"


AnyFrame: TypeAlias = Mesh | Points | Volume | list[DepthImage | ColorImage]
"""A frame, checked."""


def frame_of(frame: Any, *, drop_invalid: bool = False) -> AnyFrame:
    """Check a frame of any kind."""
    match frame:
        case Mesh():
            return mesh_of(frame.vertices, frame.faces, frame.colors)
        case Points():
            return _points(frame.positions, frame.normals, frame.colors, frame.viewpoint, drop_invalid)
        case Volume():
            return _volume(frame)
        case DepthImage() | ColorImage():
            return _images([frame])
        case np.ndarray():
            if frame.size and frame.dtype.kind in "iu":
                raise TypeError(
                    f"points have dtype {frame.dtype}: an array of points has floats (metres). "
                    "A source of one mesh is [(vertices, faces)]. Points of integers are isv.Points(array)."
                )
            return _points(frame, None, None, None, drop_invalid)
        case list() if frame and all(isinstance(image, (DepthImage, ColorImage)) for image in frame):
            return _images(frame)
        case tuple() if len(frame) in (2, 3):
            return mesh_of(*frame)
    return _foreign(frame, drop_invalid)


def _foreign(frame: Any, drop_invalid: bool) -> AnyFrame:
    """A frame of trimesh or Open3D, known by what it has: neither is imported."""
    if hasattr(frame, "vertices") and hasattr(frame, "faces") and hasattr(frame, "visual"):
        return mesh_of(frame.vertices, frame.faces, _trimesh_colors(frame.visual))
    if hasattr(frame, "vertices") and hasattr(frame, "triangles"):
        colors = frame.vertex_colors if frame.has_vertex_colors() else None
        return mesh_of(_open3d(frame.vertices), _open3d(frame.triangles), _unit_colors(colors))
    if hasattr(frame, "vertex") and hasattr(frame, "triangle"):
        vertex = frame.vertex
        return mesh_of(_open3d(vertex["positions"]), _open3d(frame.triangle["indices"]), _tensor_colors(vertex))
    if hasattr(frame, "point") and "positions" in frame.point:
        point = frame.point
        normals = _open3d(point["normals"]) if "normals" in point else None
        return _points(_open3d(point["positions"]), normals, _tensor_colors(point), None, drop_invalid)
    if hasattr(frame, "points") and hasattr(frame, "has_normals"):
        normals = _open3d(frame.normals) if frame.has_normals() else None
        colors = frame.colors if frame.has_colors() else None
        return _points(_open3d(frame.points), normals, _unit_colors(colors), None, drop_invalid)
    if hasattr(frame, "vertices") and hasattr(frame, "colors"):
        colors = np.asarray(frame.colors)
        return _points(frame.vertices, None, colors if len(colors) else None, None, drop_invalid)
    raise TypeError(
        "a frame is a mesh, points, depth images or a volume (see isv.Writer.push), not " + type(frame).__name__
    )


def _trimesh_colors(visual: Any) -> Any:
    """Colours of a trimesh: those of its vertices, or those of its texture at its vertices."""
    match getattr(visual, "kind", None):
        case None:
            return None
        case "texture":
            return np.asarray(visual.to_color().vertex_colors)
        case _:
            return np.asarray(visual.vertex_colors)


def _open3d(value: Any) -> NDArray[Any]:
    """An array of a vector or a tensor of Open3D."""
    if hasattr(value, "cpu") and hasattr(value, "numpy"):
        value = value.cpu().numpy()
    return np.asarray(value)


def _unit_colors(colors: Any) -> NDArray[np.uint8] | None:
    """Colours of 0 to 1 in 8 bits."""
    if colors is None:
        return None
    array = _open3d(colors)
    if array.dtype == np.uint8:
        return array
    scaled: NDArray[np.uint8] = np.rint(np.clip(array, 0.0, 1.0) * 255.0).astype(np.uint8)
    return scaled


def _tensor_colors(attributes: Any) -> NDArray[np.uint8] | None:
    return _unit_colors(attributes["colors"]) if "colors" in attributes else None


def _points(positions: Any, normals: Any, colors: Any, viewpoint: Any, drop_invalid: bool) -> Points:
    if drop_invalid:
        places = np.asarray(positions)
        if places.ndim == 2 and places.dtype.kind == "f":
            kept = np.isfinite(places).all(axis=1) & (places != 0).any(axis=1)
            positions = places[kept]
            normals, colors = (
                np.asarray(part)[kept] if part is not None and len(part) == len(kept) else part
                for part in (normals, colors)
            )
    return points_of(positions, normals, colors, viewpoint)


def _volume(volume: Volume) -> Volume:
    coords, distances = np.asarray(volume.coords), np.asarray(volume.distances)
    if coords.dtype.kind not in "iu":
        raise TypeError(f"coords have dtype {coords.dtype}: they are integers (blocks)")
    if coords.ndim != 2 or coords.shape[1] != 3:
        raise ValueError(f"coords have shape {coords.shape} in place of (B, 3)")
    if distances.dtype.kind != "f":
        raise TypeError(f"distances have dtype {distances.dtype}: they are numbers (metres)")
    edge = distances.shape[1] if distances.ndim == 4 else 0
    if edge not in (4, 8, 16) or distances.shape != (len(coords), edge, edge, edge):
        shape = f"({len(coords)}, edge, edge, edge), with an edge of 4, 8 or 16"
        raise ValueError(f"distances have shape {distances.shape} in place of {shape}")
    if coords.size and np.abs(coords.astype(np.int64)).max() > 2**30:
        raise ValueError("coords: a block is too far away")
    voxel = number_of("voxel", volume.voxel, "metres")
    if not (voxel > 0 and np.isfinite(voxel)):
        raise ValueError(f"voxel is {volume.voxel}: a length is above 0 (metres)")
    if not 0 < volume.truncation < 2**16:
        raise ValueError(f"truncation is {volume.truncation}: a number of voxels above 0")
    coords, distances = coords.astype(np.int32, copy=False), distances.astype(np.float32, copy=False)
    return Volume(voxel, coords, distances, int(volume.truncation))


def _images(images: list[DepthImage | ColorImage]) -> list[DepthImage | ColorImage]:
    checked: list[DepthImage | ColorImage] = []
    for image in images:
        if isinstance(image, DepthImage):
            checked.append(DepthImage(depth_of(image.depth), image.camera))
            continue
        color = np.asarray(image.color)
        if color.dtype != np.uint8:
            raise TypeError(f"colors have dtype {color.dtype}: they are uint8 (sRGB, 0 to 255)")
        if color.ndim != 3 or color.shape[2] not in (3, 4):
            raise ValueError(f"a color image has shape {color.shape} in place of (rows, columns, 3)")
        checked.append(ColorImage(color[:, :, :3], image.camera, image.depth_image))
    return checked


def _camera(camera: Camera) -> tuple[tuple[float, float], tuple[float, float], list[list[float]]]:
    if not isinstance(camera, Camera):
        raise TypeError(f"a camera is an isv.Camera, not {type(camera).__name__}")
    try:
        pose = np.asarray(camera.pose, np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"a pose is {shown(camera.pose)}: numbers of shape (4, 4)") from None
    if pose.shape != (4, 4):
        raise ValueError(f"a pose has shape {pose.shape} in place of (4, 4)")
    fx, fy = numbers_of("focal", camera.focal, 2, "focal lengths along x and y (pixels)")
    cx, cy = numbers_of("principal", camera.principal, 2, "numbers, the column and row of the principal point (pixels)")
    return (fx, fy), (cx, cy), pose.tolist()


def _sink(output: Sink) -> object:
    if isinstance(output, (str, os.PathLike)):
        return os.fspath(output)
    if isinstance(output, (_Writable, _Sending)):
        return output
    raise TypeError(f"an output is a path, a binary file or a socket, not {type(output).__name__}")
