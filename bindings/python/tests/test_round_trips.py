"""Frames to streams and back."""

from __future__ import annotations

import io
import logging
import os
import socket
import threading
from pathlib import Path
from typing import Any, Literal

import isv
import numpy as np
import pytest

from conftest import VOXEL, box, boxes, sphere_field


def encoded(source: Any, **options: Any) -> bytes:
    file = io.BytesIO()
    options.setdefault("voxel", VOXEL)
    isv.encode(source, file, **options)
    return file.getvalue()


def test_meshes_come_back_where_they_were(stream: Path) -> None:
    with isv.open(stream) as take:
        assert (len(take), take.fps, take.live) == (12, 25.0, False)
        assert take.voxel == pytest.approx(VOXEL)
        for number, frame in enumerate(take):
            mesh = frame.mesh(normals=True)
            low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
            assert np.abs(low - [0.01 * number, 0, 0]).max() < 0.01
            assert np.abs(high - [0.01 * number + 0.5, 0.4, 0.4]).max() < 0.01
            assert (frame.number, frame.timestamp_ns) == (number, 40_000_000 * number)
            assert frame.timestamp == pytest.approx(0.04 * number)
            assert mesh.normals is not None
            assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-3)
            assert mesh.colors is None


def test_arrays_have_the_stated_types_and_own_what_the_decoder_made(colored_stream: Path) -> None:
    with isv.open(colored_stream) as take:
        frame = take[0]
    mesh, points, volume = frame.mesh(normals=True), frame.points(100), frame.volume()
    assert mesh.normals is not None and mesh.colors is not None and points.normals is not None
    arrays: list[tuple[Any, Any, int]] = [
        (mesh.vertices, np.float32, 3),
        (mesh.faces, np.uint32, 3),
        (mesh.normals, np.float32, 3),
        (mesh.colors, np.uint8, 3),
        (points.positions, np.float32, 3),
        (points.normals, np.float32, 3),
        (volume.coords, np.int32, 3),
    ]
    for array, dtype, columns in arrays:
        assert array.dtype == dtype and array.shape[1] == columns
        # The base is the vector of the decoder, of which the array is no copy.
        assert array.flags.c_contiguous and array.flags.writeable and not array.flags.owndata
    assert volume.distances.dtype == np.float32 and volume.distances.shape[1:] == (8, 8, 8)
    assert len(points.positions) == 100


def test_a_frame_outlives_its_take(stream: Path) -> None:
    with isv.open(stream) as take:
        frame = take[3]
    assert len(frame.mesh().faces) > 100


def test_any_frame_is_what_it_is_in_order(stream: Path) -> None:
    with isv.open(stream) as take:
        in_order = [frame.mesh() for frame in take]
        for number in [7, 3, 4, 11, 0, 9, 10, 10, -1, -12]:
            mesh = take[number].mesh()
            assert (mesh.vertices == in_order[number].vertices).all()
            assert (mesh.faces == in_order[number].faces).all()
        assert [frame.number for frame in take[2:9:3]] == [2, 5, 8]
        assert [frame.number for frame in take[::-5]] == [11, 6, 1]


def test_iterating_twice_and_seeking_between_do_not_disturb_each_other(stream: Path) -> None:
    with isv.open(stream) as take:
        numbers = []
        for one, other in zip(take, take, strict=True):
            take[5]
            numbers.append((one.number, other.number))
        assert numbers == [(number, number) for number in range(12)]


@pytest.mark.parametrize("kind", ["path", "str", "bytes", "bytearray", "memoryview", "file", "BytesIO"])
def test_all_sources_that_can_be_sought_in_give_any_frame(stream: Path, kind: str) -> None:
    data = stream.read_bytes()
    with stream.open("rb") as file:
        sources: dict[str, Any] = {
            "path": stream,
            "str": str(stream),
            "bytes": data,
            "bytearray": bytearray(data),
            "memoryview": memoryview(data),
            "file": file,
            "BytesIO": io.BytesIO(data),
        }
        with isv.open(sources[kind]) as take:
            assert len(take) == 12
            meshes = {number: take[number].mesh().vertices for number in (8, 2, 9)}
            assert [frame.number for frame in take] == list(range(12))
    with isv.open(stream) as take:
        assert all((take[number].mesh().vertices == vertices).all() for number, vertices in meshes.items())


def test_two_takes_of_one_file_object_do_not_move_each_other(stream: Path) -> None:
    with stream.open("rb") as file:
        one, other = isv.open(file), isv.open(file)
        numbers = [(a.number, b.number) for a, b in zip(one, other, strict=True)]
    assert numbers == [(number, number) for number in range(12)]


class OnlyRead:
    """A file in which nobody can seek, that gives 100 bytes at most."""

    def __init__(self, data: bytes) -> None:
        self.file = io.BytesIO(data)

    def read(self, size: int) -> bytes:
        return self.file.read(min(size, 100))


def test_a_file_that_cannot_be_sought_in_is_live(stream: Path) -> None:
    take = isv.open(OnlyRead(stream.read_bytes()))
    assert take.live and take.fps is None and take.voxel is None
    with pytest.raises(TypeError, match="no length"):
        len(take)
    with pytest.raises(TypeError, match="no length"):
        take[0]
    assert [frame.number for frame in take] == list(range(12))
    assert take.fps == 25.0
    assert list(take) == []


def test_frames_go_through_a_socket_one_by_one() -> None:
    sender, receiver = socket.socketpair()
    shown = threading.Event()

    def send() -> None:
        with isv.Writer(sender, voxel=VOXEL, preset="realtime") as writer:
            for mesh in boxes(5):
                writer.push(mesh)
                # The next frame is made when this one was seen: none waits for another.
                assert shown.wait(60)
                shown.clear()
        sender.close()

    thread = threading.Thread(target=send)
    thread.start()
    numbers = []
    for frame in isv.open(receiver):
        numbers.append(frame.number)
        shown.set()
    thread.join()
    receiver.close()
    assert numbers == list(range(5))


def test_levels_of_detail_are_coarser(stream: Path) -> None:
    faces = []
    levels: tuple[Literal[1, 2, 4], ...] = (1, 2, 4)
    for lod in levels:
        with isv.open(stream, lod=lod) as take:
            faces.append(len(take[4].mesh().faces))
    assert faces[0] > 3 * faces[1] > 6 * faces[2] > 0


def test_colors_come_back_unless_they_are_left_out(colored_stream: Path) -> None:
    with isv.open(colored_stream) as take:
        for frame in take:
            mesh, points = frame.mesh(), frame.points(500)
            for places, colors in ((mesh.vertices, mesh.colors), (points.positions, points.colors)):
                assert colors is not None and len(colors) == len(places)
                along = (places[:, 0] - places[:, 0].min()) / np.ptp(places[:, 0])
                red = colors[:, 0] > colors[:, 2]
                assert red[along < 0.2].all() and not red[along > 0.8].any()
    with isv.open(colored_stream, color=False) as take:
        assert take[0].mesh().colors is None
    assert encoded(boxes(2, colored=True), color=False) == encoded(boxes(2))


def test_volumes_come_back() -> None:
    volume = isv.maps.from_dense(sphere_field(), VOXEL)
    data = encoded([volume] * 2, voxel=None, profile="paper", full_band=True)
    decoded = isv.open(data)[1].volume()
    assert decoded.voxel == pytest.approx(VOXEL) and (decoded.edge, decoded.truncation) == (8, 8)
    dense, first = decoded.to_dense()
    expected, expected_first = volume.to_dense()
    assert (dense.shape, first) == (expected.shape, expected_first)
    near = np.abs(expected) < 2 * VOXEL
    assert np.abs(dense[near] - expected[near]).max() < 0.25 * VOXEL


def test_the_field_of_a_mesh_is_distance_to_it(stream: Path) -> None:
    with isv.open(stream) as take:
        volume = take[0].volume()
    centre = np.array([0.5, 0.4, 0.4]) / 2
    block, z, y, x = np.nonzero(np.isfinite(volume.distances))
    places = (volume.coords[block] * volume.edge + np.stack([x, y, z], axis=1) + 0.5) * volume.voxel
    # Distance to a box: of places outside of it the one to its nearest point, of others the one to its nearest face.
    beyond = np.abs(places - centre) - centre
    distance = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
    found = volume.distances[block, z, y, x]
    near = np.abs(distance) < VOXEL
    assert near.sum() > 1000
    assert np.median(np.abs(found[near] - distance[near])) < 0.1 * VOXEL


def test_points_with_normals_become_a_surface() -> None:
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(40), np.arange(40)))
    positions = np.stack([0.01 * x, 0.01 * y, 0 * x], axis=1)
    normals = np.tile(np.array([0, 0, 1], np.float32), (len(positions), 1))
    colors = np.tile(np.array([200, 90, 20], np.uint8), (len(positions), 1))
    frame = isv.open(encoded([isv.Points(positions, normals, colors)]))[0]
    mesh = frame.mesh()
    assert np.abs(mesh.vertices[:, 2]).max() < 0.05 and len(mesh.faces) > 300
    assert mesh.colors is not None
    assert (np.abs(mesh.colors.astype(int) - [200, 90, 20]).max(axis=1) < 9).mean() > 0.9
    # Without normals they are estimated, if that is asked for.
    assert len(isv.open(encoded([positions], estimate_normals=True, viewpoint=(0, 0, 2)))[0].mesh().faces) > 300


def test_points_of_no_reading_are_left_out_if_that_is_asked_for() -> None:
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(40), np.arange(40)))
    positions = np.stack([0.01 * x, 0.01 * y, 1 + 0 * x], axis=1)
    normals = np.tile(np.array([0, 0, 1], np.float32), (len(positions), 1))
    holes = np.concatenate([positions, [[np.nan, 0, 0], [0, 0, 0]]])
    their_normals = np.concatenate([normals, [[0, 0, 1], [0, 0, 1]]])
    sound = encoded([isv.Points(positions, normals)])
    assert encoded([isv.Points(holes, their_normals)], drop_invalid_points=True) == sound
    with pytest.raises(ValueError, match="row 1600 is .* not finite"):
        encoded([isv.Points(holes, their_normals)])


def depth_and_color() -> list[isv.DepthImage | isv.ColorImage]:
    camera = isv.Camera.from_matrix(np.array([[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]), np.eye(4))
    color = np.zeros((48, 64, 3), np.uint8)
    color[:, :32], color[:, 32:] = [210, 40, 40], [40, 40, 210]
    return [isv.DepthImage(np.full((48, 64), 1.0, np.float32), camera), isv.ColorImage(color, camera, 0)]


def test_depth_images_become_a_surface_with_the_colors_of_cameras() -> None:
    mesh = isv.open(encoded([depth_and_color()]))[0].mesh()
    assert np.abs(mesh.vertices[:, 2] - 1).max() < 0.02
    assert mesh.colors is not None
    sides = np.abs(mesh.vertices[:, 0]) > 0.05
    assert ((mesh.colors[:, 0] > mesh.colors[:, 2]) == (mesh.vertices[:, 0] < 0))[sides].all()


def test_depth_in_integers_is_in_millimetres() -> None:
    metres, color = depth_and_color()
    assert isinstance(metres, isv.DepthImage)
    millimetres = isv.DepthImage((metres.depth * 1000).astype(np.uint16), metres.camera)
    assert encoded([millimetres]) == encoded([[metres]])


def test_units_origin_and_up_place_meshes() -> None:
    mesh = box()
    # Z up in millimetres, around a place far away.
    turned = mesh.vertices[:, [0, 2, 1]].astype(np.float64) * [1, -1, 1] * 1000 + [5e8, 4e8, 0]
    placed = isv.Mesh(turned, mesh.faces)
    plain = encoded([mesh], sign="closed")
    assert encoded([placed], units="mm", origin=(5e8, 4e8, 0), up="z", sign="closed") == plain


def test_times_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "times.isv"
    with isv.Writer(path, voxel=VOXEL) as writer:
        for number, time in enumerate([10.0, 10.05, 10.5]):
            writer.push(box(0.01 * number), time=time)
    with isv.open(path) as take:
        assert [frame.timestamp_ns for frame in take] == [0, 50_000_000, 500_000_000]


@pytest.mark.parametrize("kind", ["points", "depth", "volume"])
def test_times_of_other_frames_are_kept(kind: str) -> None:
    pose = np.eye(4)
    frames: dict[str, Any] = {
        "points": isv.Points(box().vertices),
        "depth": isv.DepthImage(np.full((48, 64), 1.0, np.float32), isv.Camera((60, 60), (32, 24), pose)),
        "volume": isv.maps.from_dense(sphere_field(), VOXEL),
    }
    file = io.BytesIO()
    with isv.Writer(file, voxel=VOXEL) as writer:
        for time in [10.0, 10.05, 10.5]:
            writer.push(frames[kind], time=time)
    with isv.open(file.getvalue()) as take:
        assert [frame.timestamp_ns for frame in take] == [0, 50_000_000, 500_000_000]


def test_reports_say_what_became_of_the_take(tmp_path: Path) -> None:
    path = tmp_path / "report.isv"
    steps: list[tuple[int, int | None]] = []
    report = isv.encode(boxes(4), path, voxel=VOXEL, fps=10, progress=lambda done, total: steps.append((done, total)))
    assert (report.frames, report.empty, report.skipped, report.shell) == (4, 0, 0, None)
    assert report.bytes == path.stat().st_size
    assert report.duration == pytest.approx(0.4) and report.voxel == pytest.approx(VOXEL)
    assert report.mbps == pytest.approx(report.bytes * 8 / 0.4 / 1e6)
    assert steps == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_iterators_and_parts_of_iterables_are_encoded() -> None:
    steps: list[tuple[int, int | None]] = []
    part = encoded(iter(boxes(9)), frames=slice(2, 5), progress=lambda done, total: steps.append((done, total)))
    assert part == encoded(boxes(9)[2:5])
    assert steps == [(1, None), (2, None), (3, None)]


def test_empty_frames_and_bad_frames_are_counted() -> None:
    empty = (np.empty((0, 3)), np.empty((0, 3), int))
    file = io.BytesIO()
    bad = (np.full((3, 3), np.nan), [[0, 1, 2]])
    report = isv.encode([box(), empty, bad, box(0.01)], file, voxel=VOXEL, skip_bad_frames=True)
    assert (report.frames, report.empty, report.skipped) == (3, 1, 1)
    assert [len(frame.mesh().faces) > 0 for frame in isv.open(file.getvalue())] == [True, False, True]


def test_what_is_lost_is_held_if_that_is_asked_for(stream: Path, caplog: pytest.LogCaptureFixture) -> None:
    data = bytearray(stream.read_bytes())
    starts = [at for at in range(len(data)) if data[at : at + 4] == b"ISVP"]
    data[starts[4] - 1] ^= 0xFF
    with pytest.raises(isv.IsvError) as failure:
        list(isv.open(data))
    assert failure.value.kind == "stream"
    with caplog.at_level(logging.INFO, logger="isv"):
        frames = list(isv.open(data, after_loss="hold"))
    assert [frame.number for frame in frames] == list(range(12))
    assert (frames[3].mesh().vertices == frames[2].mesh().vertices).all()
    assert any("is lost" in record.getMessage() for record in caplog.records)
    # Any frame, in any order.
    take = isv.open(data, after_loss="hold")
    for number in (11, 3, 7):
        assert (take[number].mesh().vertices == frames[number].mesh().vertices).all()
    # Other frames may be asked for on the way.
    numbers = []
    for frame in take:
        assert take[0].number == 0
        numbers.append(frame.number)
    assert numbers == list(range(12))


def test_held_frames_are_there_by_number_behind_those_that_are_counted(stream: Path) -> None:
    data = stream.read_bytes()
    starts = [at for at in range(len(data)) if data[at : at + 4] == b"ISVP"]
    # A frame in the middle is gone, and with it the index and the end.
    cut = data[: starts[4]] + data[starts[5] : starts[-1]]
    take = isv.open(cut, after_loss="hold")
    numbers = [frame.number for frame in take]
    assert len(numbers) > len(take) and numbers == list(range(len(numbers)))
    assert take[numbers[-1]].number == numbers[-1]
    for wrong in (len(numbers), 2**70):
        with pytest.raises(IndexError):
            take[wrong]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_a_pipe_with_a_name_is_a_live_stream(stream: Path, tmp_path: Path) -> None:
    pipe = tmp_path / "live.isv"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(stream.read_bytes(),))
    writer.start()
    with isv.open(pipe) as take:
        assert take.live
        assert [frame.number for frame in take] == list(range(12))
    writer.join()


def test_what_a_file_raises_while_it_is_opened_is_raised(stream: Path) -> None:
    class Failing(io.BytesIO):
        def seek(self, at: int, whence: int = 0) -> int:
            if whence == 2:
                raise OSError("the end is far away")
            return super().seek(at, whence)

    with pytest.raises(OSError, match="far away"):
        isv.open(Failing(stream.read_bytes()))


def test_decisions_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="isv"):
        encoded([box()])
    assert caplog.records and all(record.name == "isv" for record in caplog.records)


def test_bit_rates_and_errors_are_targets() -> None:
    frames = boxes(3)
    assert len(encoded(frames, quality=90)) > len(encoded(frames, quality=10))
    assert len(encoded(frames, max_error=0.0002)) > len(encoded(frames, max_error=0.004))
    assert len(encoded(frames, bitrate_mbps=5)) > len(encoded(frames, bitrate_mbps=0.05))


def test_the_number_of_threads_changes_no_bit(stream: Path) -> None:
    with isv.open(stream) as take:
        expected = take[6].mesh().vertices
    try:
        for threads in (1, 3):
            isv.set_threads(threads)
            assert (isv.open(stream)[6].mesh().vertices == expected).all()
    finally:
        isv.set_threads(None)


def test_many_threads_may_use_one_take(stream: Path) -> None:
    with isv.open(stream) as take:
        expected = [frame.mesh().vertices for frame in take]
        wrong = []

        def use(start: int) -> None:
            for number in (start, 11 - start, (start + 5) % 12):
                if not (take[number].mesh().vertices == expected[number]).all():
                    wrong.append(number)

        threads = [threading.Thread(target=use, args=(start,)) for start in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert wrong == []


def test_the_file_has_its_name_once_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "take.isv"
    with isv.Writer(path, voxel=VOXEL) as writer:
        writer.push(box())
        assert not path.exists()
    assert path.exists() and writer.report == writer.close()
    before = path.read_bytes()
    with pytest.raises(ZeroDivisionError), isv.Writer(path, voxel=VOXEL) as writer:
        writer.push(box())
        raise ZeroDivisionError
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_parts_of_a_surface_change_where_something_moves() -> None:
    def frames() -> Any:
        standing = box(0.0, colored=True)
        for number in range(3):
            moving = box(2.0 + 0.01 * number, colored=True)
            sides = [standing, moving]
            faces = np.concatenate([standing.faces, moving.faces + len(standing.vertices)])
            yield np.concatenate([s.vertices for s in sides]), faces, np.concatenate([s.colors for s in sides])

    parts = isv.SurfaceParts(normals=True)
    assert len(parts) == 0 and list(parts) == []
    for frame in isv.open(encoded(frames())):
        changed, removed = parts.update(frame)
        assert set(changed) <= set(parts) and not set(removed) & set(parts)
        if frame.number > 0:
            assert changed and all(x * 8 * VOXEL > 1 for x, _, _ in changed)
        meshes = [parts[place] for place in parts]
        whole = frame.mesh(normals=True)
        for name in ("vertices", "normals", "colors"):
            corners = [getattr(mesh, name)[mesh.faces] for mesh in meshes]
            assert np.array_equal(np.concatenate(corners), getattr(whole, name)[whole.faces]), name
        assert parts.update(frame) == ([], [])
    assert "parts" in repr(parts)
    with pytest.raises(KeyError):
        parts[(1000, 0, 0)]
    assert isv.SurfaceParts().update(frame)[0] and parts[changed[0]].normals is not None
