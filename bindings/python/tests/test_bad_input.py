"""Bad input is one clear exception each."""

from __future__ import annotations

import io
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import isv
import numpy as np
import pytest
from isv import _options

from conftest import VOXEL, box, sphere_field

TRIANGLE = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]
CAMERA = isv.Camera((50, 50), (4, 4), np.eye(4))


def camera(**parts: Any) -> isv.Camera:
    return isv.Camera(**{"focal": (50, 50), "principal": (4, 4), "pose": np.eye(4), **parts})


def depth(**parts: Any) -> isv.DepthImage:
    return isv.DepthImage(**{"depth": np.ones((8, 8), np.float32), "camera": CAMERA, **parts})


def volume(**parts: Any) -> isv.Volume:
    whole = {"voxel": 0.02, "coords": [[0, 0, 0]], "distances": np.zeros((1, 8, 8, 8), np.float32), "truncation": 8}
    return isv.Volume(**{**whole, **parts})


BAD_FRAMES: list[tuple[Any, type[Exception], str]] = [
    ((TRIANGLE, [[0, 1, 3]]), ValueError, "vertex 3 asked for, but there are 3"),
    ((TRIANGLE, [[0, 1, -1]]), ValueError, "vertex -1 asked for, but there are 3"),
    ((TRIANGLE, [[0, 1, 2**40]]), ValueError, f"vertex {2**40} asked for"),
    ((TRIANGLE, [[0, 1]]), ValueError, r"faces have shape \(1, 2\) in place of \(N, 3\)"),
    ((TRIANGLE, [[0.0, 1.0, 2.0]]), TypeError, "faces have dtype float64: they are integers"),
    (([[0.0, 0], [1, 0]], [[0, 1, 1]]), ValueError, r"vertices have shape \(2, 2\) in place of \(N, 3\)"),
    ((np.zeros((2, 3, 3)), [[0, 1, 1]]), ValueError, "vertices have shape"),
    ((np.zeros(3), [[0, 1, 1]]), ValueError, "vertices have shape"),
    (([["a", "b", "c"]], [[0, 0, 0]]), TypeError, "vertices have dtype <U1: they are numbers"),
    ((np.zeros((3, 3), complex), [[0, 1, 2]]), TypeError, "vertices have dtype complex128"),
    ((np.zeros((3, 3), bool), [[0, 1, 2]]), TypeError, "vertices have dtype bool"),
    (([[np.nan, 0, 0], *TRIANGLE], [[1, 2, 3]]), ValueError, "row 0 is .* not finite"),
    (([*TRIANGLE, [0, np.inf, 0]], [[0, 1, 2]]), ValueError, "row 3 is .* not finite"),
    ((TRIANGLE, [[0, 1, 2]], np.zeros((2, 3), np.uint8)), ValueError, "there are 2 colors for 3 positions"),
    ((TRIANGLE, [[0, 1, 2]], np.zeros((3, 3))), TypeError, "colors have dtype float64: they are uint8"),
    ((TRIANGLE, [[0, 1, 2]], np.zeros((3, 2), np.uint8)), ValueError, r"colors have shape \(3, 2\)"),
    (isv.Mesh(np.zeros((3, 2)), np.zeros((0, 3), int)), ValueError, "vertices have shape"),
    (isv.Points(np.zeros((3, 3)), np.zeros((2, 3), np.float32)), ValueError, "there are 2 normals for 3 positions"),
    (isv.Points(np.zeros((3, 3)), np.full((3, 3), np.nan, np.float32)), ValueError, "normals: row 0"),
    (np.zeros((3, 2)), ValueError, "positions have shape"),
    (np.full((3, 3), np.nan), ValueError, "positions: row 0"),
    (np.array([[0, 1, 2]], np.int64), TypeError, r"points have dtype int64: .*isv\.Points\(array\)"),
    (depth(depth=np.zeros(8, np.float32)), ValueError, "a depth image has shape"),
    (depth(depth=np.zeros((8, 8), bool)), TypeError, "depths have dtype bool"),
    (depth(camera=camera(pose=np.eye(3))), ValueError, r"a pose has shape \(3, 3\)"),
    (depth(camera=camera(pose=np.full((4, 4), np.nan))), isv.IsvError, "."),
    (depth(camera=camera(focal=(0, 50))), isv.IsvError, "make no camera"),
    (depth(camera=camera(focal=(-50, 50))), isv.IsvError, "fx is -50"),
    (depth(depth=np.zeros((0, 8), np.float32)), isv.IsvError, "."),
    (depth(camera=camera(focal=(20,))), ValueError, r"focal is \(20,\): 2 focal lengths"),
    (depth(camera=camera(focal=20)), TypeError, "focal is 20: 2 focal lengths"),
    (depth(camera=camera(principal=(1, "2"))), TypeError, "principal is '2': a number"),
    (depth(camera=camera(pose="here")), TypeError, "a pose is 'here': numbers of shape"),
    (([[0.0, 0, 0], [1, 0]], [[0, 1, 1]]), ValueError, "vertices: "),
    (isv.Points(np.zeros((3, 3)), viewpoint=(1, 2)), ValueError, r"viewpoint is \(1, 2\): 3 coordinates"),  # type: ignore[arg-type]
    (volume(voxel=True), TypeError, "voxel is True: a number"),
    (depth(camera="here"), TypeError, "a camera is an isv.Camera, not str"),
    ([depth(), isv.ColorImage(np.zeros((8, 8, 3)), CAMERA)], TypeError, "uint8"),  # type: ignore[arg-type]
    ([depth(), isv.ColorImage(np.zeros((8, 8), np.uint8), CAMERA)], ValueError, "a color image has shape"),
    (volume(voxel=-0.02), ValueError, "voxel is -0.02"),
    (volume(voxel=float("nan")), ValueError, "voxel is nan"),
    (volume(truncation=0), ValueError, "truncation is 0"),
    (volume(coords=[[0.5, 0, 0]]), TypeError, "coords have dtype float64"),
    (volume(coords=[[0, 0]]), ValueError, r"coords have shape \(1, 2\)"),
    (volume(coords=[[0, 0, 2**40]]), ValueError, "too far away"),
    (volume(coords=[[0, 0, 2**29]]), isv.IsvError, "too far away"),
    (volume(coords=np.zeros((2, 3), int), distances=np.zeros((2, 8, 8, 8), np.float32)), isv.IsvError, "two blocks"),
    (volume(distances=np.zeros((2, 8, 8, 8), np.float32)), ValueError, "distances have shape"),
    (volume(distances=np.zeros((1, 8, 8, 4), np.float32)), ValueError, "distances have shape"),
    (volume(distances=np.zeros((1, 5, 5, 5), np.float32)), ValueError, "distances have shape"),
    (volume(distances=np.zeros((1, 8, 8, 8), int)), TypeError, "distances have dtype int64"),
    ("frame.ply", TypeError, "a frame is .*, not str"),
    (None, TypeError, "a frame is .*, not NoneType"),
    ((TRIANGLE,), TypeError, "a frame is .*, not tuple"),
    ([], TypeError, "a frame is .*, not list"),
    ({"vertices": TRIANGLE}, TypeError, "a frame is .*, not dict"),
]


@pytest.mark.parametrize(("frame", "kind", "words"), BAD_FRAMES)
def test_bad_frames_are_refused_and_the_next_one_may_follow(frame: Any, kind: type[Exception], words: str) -> None:
    file = io.BytesIO()
    # The first frame says of which kind all are.
    depths = isinstance(frame, isv.DepthImage) or (isinstance(frame, list) and frame)
    volumes = isinstance(frame, isv.Volume)
    good: Any = isv.maps.from_dense(sphere_field(), VOXEL) if volumes else depth() if depths else box()
    options: isv.EncodeOptions = {} if volumes else {"voxel": 0.05}
    with isv.Writer(file, **options) as writer:
        with pytest.raises(kind, match=words):
            writer.push(frame)
        writer.push(good)
    assert writer.report is not None and writer.report.frames == 1


BAD_OPTIONS: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"quality": 101}, ValueError, "0 to 100"),
    ({"quality": float("nan")}, ValueError, "0 to 100"),
    ({"quality": "best"}, TypeError, "."),
    ({"quality": 50, "bitrate_mbps": 1}, ValueError, "exclude each other"),
    ({"bitrate_mbps": 0}, ValueError, "."),
    ({"max_error": -0.001}, ValueError, "."),
    ({"voxel": -0.005}, ValueError, "voxel is -0.005: a length is above 0"),
    ({"voxel": 0}, ValueError, "voxel is 0"),
    ({"voxel": float("inf")}, ValueError, "voxel is inf"),
    ({"voxel": 1e9}, ValueError, "."),
    ({"voxel": "small"}, ValueError, r"voxel is 'small': .*such as voxel=0\.005, or \"auto\""),
    ({"voxel": "5mm"}, ValueError, r"voxel is '5mm': a number \(metres\), such as voxel=0\.005, or"),
    ({"voxel": True}, TypeError, "voxel is True: a number"),
    ({"voxel": 10**400}, ValueError, "voxel is an integer of 1329 bits: too large"),
    ({"voxel": []}, TypeError, r"voxel is \[\]: a number"),
    ({"max_error": "1mm"}, TypeError, r"max_error is '1mm': a number \(metres\), such as max_error=0\.001"),
    ({"fps": "30"}, TypeError, r"fps is '30': a number \(frames a second\)"),
    ({"voxel": "auto"}, ValueError, "."),
    ({"fps": 0}, ValueError, "a rate is above 0"),
    ({"gop": 0}, ValueError, "gop is 0"),
    ({"gop": -5}, ValueError, "gop is -5"),
    ({"gop": 2**40}, ValueError, "gop is"),
    ({"gop": 2**70}, ValueError, f"gop is {2**70}: a number from 1 to {2**32 - 1}"),
    ({"gop": 1.5}, TypeError, "gop is 1.5: a whole number"),
    ({"gop": True}, TypeError, "gop is True: a whole number"),
    ({"time_origin": -1}, ValueError, "time_origin is -1: a number from 0 on"),
    ({"time_origin": 2**70}, ValueError, "time_origin is"),
    ({"checksums": 1}, TypeError, "checksums is 1: True or False"),
    ({"color": "no"}, TypeError, "color is 'no': True or False"),
    ({"title": 3}, TypeError, "title is 3: text"),
    ({"title": "\ud800"}, ValueError, "title is .*surrogate"),
    ({"preset": 2}, TypeError, "preset is 2: text"),
    ({"preset": "fast"}, ValueError, 'preset is "realtime" or "balanced" or "archive", not "fast"'),
    ({"refresh": "never"}, ValueError, "refresh is"),
    ({"sign": "both"}, ValueError, "sign is"),
    ({"units": "miles"}, ValueError, "units"),
    ({"up": "w"}, ValueError, "up is"),
    ({"origin": (1, 2)}, ValueError, r"origin is \(1, 2\): 3 coordinates \(x, y, z\)"),
    ({"origin": 5}, TypeError, "origin is 5: 3 coordinates"),
    ({"viewpoint": "123"}, TypeError, "viewpoint is '123': 3 coordinates"),
    ({"viewpoint": (1, 2, "3")}, TypeError, "viewpoint is '3': a number"),
    ({"origin": (1, 2, float("nan"))}, ValueError, "origin is .* finite"),
    ({"color_quality": 200}, ValueError, "."),
    ({"max_blocks": 0}, ValueError, "max_blocks is 0"),
    ({"shell_offset": -1.0}, ValueError, "."),
    ({"memory_limit": -1}, ValueError, "memory_limit is -1: a number of bytes above 0"),
    ({"memory_limit": 2**64}, ValueError, "memory_limit is"),
    ({"speed": 11}, TypeError, "speed is no option of encoding$"),
    ({"nonsense": None}, TypeError, "nonsense is no option of encoding"),
    ({"bitrate": 2.0}, TypeError, "bitrate is no option of encoding; is bitrate_mbps meant?"),
    ({"colour": False}, TypeError, "is color meant?"),
]


@pytest.mark.parametrize(("options", "kind", "words"), BAD_OPTIONS)
def test_bad_options_are_refused_before_the_first_frame(
    options: dict[str, Any], kind: type[Exception], words: str, tmp_path: Path
) -> None:
    path = tmp_path / "take.isv"
    with pytest.raises(kind, match=words):
        isv.Writer(path, **options)
    assert list(tmp_path.iterdir()) == []


def test_each_option_has_a_check_and_none_is_the_default() -> None:
    names = isv.EncodeOptions.__annotations__
    assert set(_options._KINDS) == set(names)
    assert _options.options_of(dict.fromkeys(names)) == {}
    numbers = {"voxel": np.float32(0.5), "gop": np.int64(7), "fps": Fraction(25, 2), "color": np.bool_(False)}
    assert _options.options_of(numbers) == {"voxel": 0.5, "gop": 7, "fps": 12.5, "color": False}


@pytest.mark.parametrize(
    ("frames", "kind", "words"),
    [
        ("0..1", TypeError, r"frames are '0\.\.1': a slice such as slice\(10, 20\)"),
        (3, TypeError, "frames are 3: a slice"),
        ((0,), ValueError, r"frames are \(0,\): a tuple has two numbers"),
        ((0, 1.5), TypeError, "frames is 1.5: a frame number"),
        (slice(True, 3), TypeError, "frames is True: a frame number"),
        (slice(0, 3, 0), ValueError, "the step is 0"),
        (range(3, 0, -1), ValueError, "the step is -1"),
        (slice(0, 10**400), ValueError, "frames 0 to an integer of 1329 bits"),
        (slice(-2, None), ValueError, "frames -2 to None: there are none"),
    ],
)
def test_bad_ranges_of_frames_are_refused_from_all_sources(
    frames: Any, kind: type[Exception], words: str, tmp_path: Path, stream: Path
) -> None:
    for source in ([box()], stream):
        with pytest.raises(kind, match=words):
            isv.encode(source, tmp_path / "take.isv", frames=frames)
    assert list(tmp_path.iterdir()) == []


def test_closed_takes_and_writers_are_refused(stream: Path) -> None:
    take = isv.open(stream)
    take.close()
    take.close()
    assert take.closed and "closed" in repr(take)
    uses: list[Callable[[], object]] = [
        lambda: take[0],
        lambda: len(take),
        lambda: take.fps,
        lambda: next(iter(take)),
        take.__enter__,
    ]
    for use in uses:
        with pytest.raises(ValueError, match="the take is closed"):
            use()
    writer = isv.Writer(io.BytesIO(), voxel=VOXEL)
    writer.close()
    with pytest.raises(ValueError, match="the writer is closed"):
        writer.push(box())


def test_frames_that_are_not_there_are_index_errors(stream: Path) -> None:
    with isv.open(stream) as take:
        for number in (12, -13, 10**30):
            with pytest.raises(IndexError, match=f"frame {number} asked for, but there are 12"):
                take[number]
        with pytest.raises(TypeError):
            take["first"]  # type: ignore[call-overload]
        with pytest.raises(ValueError, match="at least 1 point"):
            take[0].points(0)
        with pytest.raises(ValueError, match="at least 1 point"):
            take[0].points(-3)


def test_what_is_no_stream_is_refused(tmp_path: Path, stream: Path) -> None:
    with pytest.raises(FileNotFoundError):
        isv.open(tmp_path / "missing.isv")
    with pytest.raises(IsADirectoryError):
        isv.open(tmp_path)
    (tmp_path / "text.isv").write_text("no stream " * 20)
    for source in (tmp_path / "text.isv", b"no stream " * 20, b"", io.BytesIO(b"abc")):
        with pytest.raises(isv.IsvError) as failure:
            isv.open(source)
        assert failure.value.kind == "stream"
    with pytest.raises(TypeError, match="a stream is a path, bytes, a binary file or a socket, not int"):
        isv.open(5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="mode 'rb'"), (tmp_path / "text.isv").open() as text:
        isv.open(text)  # type: ignore[arg-type]
    wrong: list[dict[str, Any]] = [{"lod": 3}, {"after_loss": "guess"}, {"memory_limit": 0}]
    for options in wrong:
        with pytest.raises(ValueError, match=next(iter(options))):
            isv.open(stream, **options)


def test_a_stream_cut_anywhere_is_frames_and_then_an_error_or_an_end(stream: Path) -> None:
    data = stream.read_bytes()
    for size in range(48, len(data), len(data) // 25):
        try:
            with isv.open(data[:size]) as take:
                numbers = [frame.number for frame in take]
        except isv.IsvError as error:
            assert error.kind == "stream"
        else:
            assert numbers == list(range(len(numbers))) and len(numbers) <= 12


def test_damage_is_an_error_behind_the_sound_frames_without_an_index_too(stream: Path) -> None:
    data = bytearray(stream.read_bytes())
    packets = [at for at in range(len(data)) if data[at : at + 4] == b"ISVP"]
    for damaged, end in ((0, len(data)), (0, -40), (7, len(data)), (7, -40)):
        broken = data[:end]
        broken[packets[damaged] + 60] ^= 1
        take = isv.open(broken)
        numbers: list[int] = []
        for _ in range(2):
            numbers.clear()
            with pytest.raises(isv.IsvError) as failure:
                numbers.extend(frame.number for frame in take)
            assert failure.value.kind == "stream"
        # Each of the frames before it can still be asked for.
        assert [take[number].number for number in range(damaged)] == list(range(damaged))


def test_any_flipped_byte_is_an_error_or_a_frame(stream: Path) -> None:
    data = stream.read_bytes()
    for at in range(0, len(data), len(data) // 60):
        damaged = bytearray(data)
        damaged[at] ^= 0x41
        try:
            with isv.open(damaged) as take:
                for frame in take:
                    frame.mesh()
        except isv.IsvError as error:
            assert error.kind in ("stream", "memory")


def test_frames_above_the_memory_allowed_are_refused(stream: Path) -> None:
    with pytest.raises(isv.IsvError) as failure:
        isv.open(stream, memory_limit=1000)[0]
    assert failure.value.kind == "memory"


class Failing(io.RawIOBase):
    """A file that fails in its own way, after some bytes."""

    def __init__(self, data: bytes, good: int) -> None:
        self.data, self.at, self.good = data, 0, good

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return False

    def read(self, size: int = -1) -> bytes:
        if self.at >= self.good:
            raise ZeroDivisionError("of the file")
        part = self.data[self.at : min(self.at + size, self.good)]
        self.at += len(part)
        return part

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        raise ZeroDivisionError("of the file")


def test_what_a_file_raises_comes_through(stream: Path, tmp_path: Path) -> None:
    data = stream.read_bytes()
    with pytest.raises(ZeroDivisionError, match="of the file"):
        list(isv.open(Failing(data, len(data) // 2)))
    with pytest.raises(ZeroDivisionError, match="of the file"):
        isv.encode([box()], Failing(b"", 0), voxel=VOXEL)
    folder = tmp_path / "take"
    isv.encode([box()], tmp_path / "take.isv", voxel=VOXEL)
    with pytest.raises(ZeroDivisionError, match="of the file"):
        isv.encode(tmp_path / "take.isv", Failing(b"", 0), voxel=VOXEL)
    assert not folder.exists()


def test_a_file_cannot_use_what_calls_it(stream: Path) -> None:
    class Nested:
        """A sink that pushes another frame while it is written to, and a source that reads a frame while it is read."""

        def __init__(self) -> None:
            self.data = io.BytesIO(stream.read_bytes())
            self.user: Any = None

        def write(self, data: bytes) -> int:
            if self.user is not None:
                self.user.push(box())
            return len(data)

        def read(self, size: int) -> bytes:
            if self.user is not None:
                self.user[0]
            return self.data.read(size)

        def seek(self, place: int, whence: int = 0) -> int:
            return self.data.seek(place, whence)

        def seekable(self) -> bool:
            return True

    sink = Nested()
    writer = isv.Writer(sink, voxel=VOXEL)
    sink.user = writer
    with pytest.raises(RuntimeError, match="that calls it"):
        for _ in range(4):
            writer.push(box())
        writer.close()
    source = Nested()
    take = isv.open(source)
    source.user = take
    with pytest.raises(RuntimeError, match="that calls it"):
        take[0]


def test_a_sink_says_how_much_it_took() -> None:
    class Sink(io.RawIOBase):
        def __init__(self, answer: Any) -> None:
            self.answer = answer

        def writable(self) -> bool:
            return True

        def write(self, data: Any) -> Any:
            return self.answer

    with pytest.raises(BlockingIOError, match="took nothing"):
        isv.encode([box()], Sink(None), voxel=VOXEL)
    with pytest.raises(ValueError, match="took 1000000 of"):
        isv.encode([box()], Sink(1_000_000), voxel=VOXEL)

    class Collector:
        """As people write them: nothing is returned where all was taken."""

        def __init__(self) -> None:
            self.data = b""

        def write(self, data: bytes) -> None:
            self.data += data

    collector = Collector()
    report = isv.encode([box()], collector, voxel=VOXEL)
    assert len(collector.data) == report.bytes


def test_files_that_give_something_else_are_refused(stream: Path) -> None:
    class Wrong:
        def __init__(self, answer: object) -> None:
            self.answer = answer

        def read(self, size: int) -> Any:
            return self.answer

    with pytest.raises(TypeError):
        list(isv.open(Wrong("text")))
    with pytest.raises(isv.IsvError, match="more than was asked for"):
        list(isv.open(Wrong(b"x" * 1_000_000)))


def test_sources_and_outputs_of_other_types_are_refused(tmp_path: Path, stream: Path) -> None:
    path = tmp_path / "take.isv"
    for source in (5, b"bytes", None):
        with pytest.raises(TypeError, match="a source is a path or an iterable of frames"):
            isv.encode(source, path)
    with pytest.raises(TypeError, match="put the Mesh into a list"):
        isv.encode(box(), path)
    with pytest.raises(TypeError, match="an output is a path, a binary file or a socket, not int"):
        isv.encode([box()], 7)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="progress is a function, not int"):
        isv.encode([box()], path, progress=7)  # type: ignore[arg-type]
    with pytest.raises(FileNotFoundError):
        isv.encode(tmp_path / "missing", path)
    with pytest.raises(ValueError, match="there are none"):
        isv.encode([box()], path, frames=slice(3, 3))
    with pytest.raises(ValueError, match="the step is 2"):
        isv.encode([box()], path, frames=slice(0, 9, 2))
    assert list(tmp_path.iterdir()) == []


def test_one_mesh_in_place_of_a_source_is_refused(tmp_path: Path, stream: Path) -> None:
    path = tmp_path / "take.isv"
    path.write_bytes(stream.read_bytes())
    vertices, faces = np.array(TRIANGLE), np.array([[0, 1, 2]])
    for mesh in ((vertices, faces), (vertices, faces, np.zeros((3, 3), np.uint8))):
        with pytest.raises(TypeError, match=r"A source of one mesh is \[\(vertices, faces\)\]"):
            isv.encode(mesh, path, voxel=VOXEL, skip_bad_frames=True)
        assert path.read_bytes() == stream.read_bytes()
    # Points on a lattice of integers are points where their type says so.
    report = isv.encode([isv.Points(faces)], path, voxel=0.5)
    assert report.frames == 1


def test_a_source_without_frames_replaces_no_stream(tmp_path: Path, stream: Path) -> None:
    path, sink = tmp_path / "take.isv", io.BytesIO()
    path.write_bytes(stream.read_bytes())
    bad = isv.Mesh(np.full((3, 3), np.nan), np.array([[0, 1, 2]]))
    sources: list[tuple[Any, dict[str, Any], str]] = [
        ([], {}, "there are no frames$"),
        (iter(()), {}, "there are no frames$"),
        ([box()], {"frames": slice(3, 5)}, r"there are no frames \(frames 3 to 4\)"),
        ((box() for _ in range(2)), {"frames": slice(2, None)}, r"there are no frames \(frames from 2 on\)"),
        ([bad, bad], {"skip_bad_frames": True}, "no frame could be used, 2 skipped"),
    ]
    for source, options, words in sources:
        with pytest.raises(ValueError, match=words):
            isv.encode(source, path, voxel=VOXEL, **options)
        assert path.read_bytes() == stream.read_bytes() and list(tmp_path.iterdir()) == [path]
    with pytest.raises(ValueError, match="there are no frames"):
        isv.encode([], sink, voxel=VOXEL)
    assert sink.getvalue() == b""
    # Frames without a surface are frames.
    empty = isv.Mesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert isv.encode([empty], path, voxel=VOXEL).empty == 1


def test_negative_times_and_units_of_cameras_are_refused() -> None:
    with isv.Writer(io.BytesIO(), voxel=VOXEL) as writer:
        writer.push(box())
        with pytest.raises(ValueError, match="seconds from 0 on"):
            writer.push(box(), time=-1.0)
    with isv.Writer(io.BytesIO(), units="mm") as writer, pytest.raises(ValueError, match="for meshes and points"):
        writer.push(depth())


def test_nothing_but_streams_is_overwritten(tmp_path: Path, stream: Path) -> None:
    precious = tmp_path / "scan.ply"
    precious.write_bytes(b"ply of a museum")
    jobs: list[Callable[[], object]] = [
        lambda: isv.encode([box()], precious, voxel=VOXEL),
        lambda: isv.encode(stream, precious, voxel=VOXEL),
        lambda: isv.join([stream], precious),
        lambda: isv.cut(stream, precious, slice(0, 2)),
        lambda: isv.repair(stream, precious),
        lambda: isv.repair(stream, stream),
        lambda: isv.join([stream, stream], stream),
    ]
    for job in jobs:
        with pytest.raises(isv.IsvError) as failure:
            job()
        assert failure.value.kind == "output"
    assert precious.read_bytes() == b"ply of a museum" and list(tmp_path.iterdir()) == [precious]


def test_jobs_on_files_refuse_what_cannot_be(tmp_path: Path, stream: Path) -> None:
    out = tmp_path / "out.isv"
    (tmp_path / "text.isv").write_text("no stream " * 20)
    with pytest.raises(FileNotFoundError):
        isv.info(tmp_path / "missing.isv")
    with pytest.raises(ValueError, match="no stream to join"):
        isv.join([], out)
    with pytest.raises(TypeError, match="a list of paths"):
        isv.join(str(stream), out)
    with pytest.raises(ValueError, match="spacing is -1"):
        isv.evaluate(stream, stream, spacing=-1)
    with pytest.raises(TypeError, match=r"spacing is '5mm': a number \(metres\), such as spacing=0\.005"):
        isv.evaluate(stream, stream, spacing="5mm")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="test_origin is .* 3 coordinates"):
        isv.evaluate(stream, stream, test_origin=(1, 2))
    with pytest.raises(TypeError, match="bitrate_mbps meant"):
        isv.settle(stream, bitrate=2)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="threads is 0"):
        isv.set_threads(0)
    failing: list[Callable[[], object]] = [
        lambda: isv.info(tmp_path / "text.isv"),
        lambda: isv.repair(tmp_path / "text.isv", out),
        lambda: isv.cut(stream, out, slice(1, 3)),
        lambda: isv.cut(stream, out, slice(0, 99)),
        lambda: isv.evaluate(stream, tmp_path / "text.isv"),
    ]
    for job in failing:
        with pytest.raises(isv.IsvError):
            job()
    assert not out.exists()
