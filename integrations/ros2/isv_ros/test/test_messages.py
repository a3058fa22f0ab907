"""The core without ROS: `python -m pytest integrations/ros2/isv_ros/test`."""

from types import SimpleNamespace

import isv
import numpy as np
import pytest
from isv_ros import clouds
from isv_ros.messages import Receiver, Sender


def ball(frame: int) -> isv.Points:
    """Points on a ball that moves, seen from outside."""
    random = np.random.default_rng(1)
    normals = random.normal(size=(20_000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    positions = 0.3 * normals + [0.05 * frame, 0.0, 0.0]
    colours = np.full((20_000, 3), [200, 60, 20], np.uint8)
    return isv.Points(positions.astype(np.float32), normals.astype(np.float32), colours)


def field(frame: int) -> isv.Volume:
    """A field of signed distances of a ball that moves: 4 x 4 x 4 blocks of 8 x 8 x 8 voxels of 2 cm."""
    coords = np.stack(np.meshgrid(*[np.arange(-2, 2)] * 3, indexing="ij"), -1).reshape(-1, 3).astype(np.int32)
    z, y, x = np.meshgrid(*[np.arange(8)] * 3, indexing="ij")
    voxels = np.stack([x, y, z], -1) + 8 * coords[:, None, None, None, :] + 0.5
    centre = [0.5 * frame, 0.0, 0.0]
    distances = 0.02 * (np.linalg.norm(voxels - centre, axis=-1) - 9)
    return isv.Volume(0.02, coords, distances.astype(np.float32), 3)


def test_a_group_that_begins_with_nothing_keeps_its_colours():
    sender, receiver = Sender(voxel=0.02, gop=2), Receiver()
    nothing = np.zeros((0, 3), np.float32)
    for frame in (ball(0), ball(1), isv.Points(nothing, nothing), ball(3)):
        (arrived,) = receiver.push(sender.push(frame))
    np.testing.assert_allclose(np.median(arrived.frame.mesh().colors, axis=0), [200, 60, 20], atol=6)


def test_frames_arrive_one_by_one():
    sender, receiver = Sender(voxel=0.02, gop=4), Receiver()
    for frame in range(10):
        message = sender.push(ball(frame))
        (arrived,) = receiver.push(message)
        mesh = arrived.frame.mesh()
        middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        np.testing.assert_allclose(middle, [0.05 * frame, 0, 0], atol=0.02)
        np.testing.assert_allclose(np.median(mesh.colors, axis=0), [200, 60, 20], atol=6)
        assert len(message) < 0.1 * ball(frame).positions.nbytes
    receiver.close()


def test_each_frame_has_its_time_and_its_coordinate_frame():
    sender, receiver = Sender(voxel=0.02, gop=2), Receiver()
    said = [(0, ""), (1_700_000_000_123_456_789, "lidar"), (-1, "wieża/lidar"), (5, "x" * 65535)]
    for frame, (stamp_ns, frame_id) in enumerate(said):
        (arrived,) = receiver.push(sender.push(ball(frame), stamp_ns, frame_id))
        assert (arrived.stamp_ns, arrived.frame_id) == (stamp_ns, frame_id)
    for stamp_ns, frame_id in [(0, "x" * 65536), (1 << 63, "")]:
        with pytest.raises(ValueError, match="at most"):
            sender.push(ball(4), stamp_ns, frame_id)
    (arrived,) = receiver.push(sender.push(ball(4), 6, "lidar"))
    assert arrived.stamp_ns == 6, "what was refused has not ended the group"
    receiver.close()


def test_fields_arrive_too():
    sender, receiver = Sender(voxel=0.02), Receiver()
    for frame in range(3):
        (arrived,) = receiver.push(sender.push(field(frame)))
        vertices = arrived.frame.mesh().vertices
        assert abs(np.linalg.norm(vertices - [0.01 * frame, 0, 0], axis=1).mean() - 0.18) < 0.004
    receiver.close()


def test_who_comes_late_or_misses_a_message_goes_on_at_the_next_group():
    sender = Sender(voxel=0.02, gop=3)
    messages = [sender.push(ball(frame)) for frame in range(9)]
    late = Receiver()
    assert [len(late.push(message)) for message in messages[1:]] == [0, 0, 1, 1, 1, 1, 1, 1]
    lossy = Receiver()
    arrived = [len(lossy.push(message)) for message in messages[:4] + messages[5:]]
    assert arrived == [1, 1, 1, 1, 0, 1, 1, 1]
    late.close()
    lossy.close()


def test_damaged_messages_are_refused_and_the_next_group_is_whole():
    sender, receiver = Sender(voxel=0.02, gop=2), Receiver()
    messages = [sender.push(ball(frame)) for frame in range(4)]
    with pytest.raises(ValueError):
        receiver.push(b"1234")
    with pytest.raises(ValueError):
        receiver.push(messages[0][:18] + 100 * b"no stream at all")
    with pytest.raises(ValueError, match="completes no frame"):
        receiver.push(messages[0][:-20])
    assert receiver.push(messages[1]) == []
    assert [len(receiver.push(message)) for message in messages[2:]] == [1, 1]
    receiver.close()


def test_a_frame_that_cannot_be_used_ends_its_group():
    sender, receiver = Sender(voxel=0.02, gop=10), Receiver()
    receiver.push(sender.push(ball(0)))
    with pytest.raises(ValueError):
        sender.push(isv.Points(np.full((10, 3), np.nan, np.float32)))
    (arrived,) = receiver.push(sender.push(ball(1)))
    assert arrived.frame.number == 0
    receiver.close()


@pytest.mark.parametrize("has_colours", [False, True])
def test_clouds_go_through_their_messages(has_colours):
    points = ball(0)
    colours = points.colors if has_colours else None
    fields = [
        SimpleNamespace(name=name, offset=offset, datatype=datatype, count=count)
        for name, offset, datatype, count in clouds.layout(has_colours)
    ]
    step = 4 * len(fields)
    count = len(points.positions)
    cloud = SimpleNamespace(
        fields=fields, height=1, width=count, point_step=step, row_step=step * count, is_bigendian=False
    )
    cloud.data = clouds.to_bytes(points.positions, colours)
    positions, found = clouds.to_arrays(cloud)
    np.testing.assert_array_equal(positions, points.positions)
    if has_colours:
        np.testing.assert_array_equal(found, colours)
    else:
        assert found is None
    cloud.width = count + 1
    with pytest.raises(ValueError, match="too few"):
        clouds.to_arrays(cloud)
    cloud.fields = fields[1:]
    with pytest.raises(ValueError, match="x, y and z"):
        clouds.to_arrays(cloud)


def test_organised_big_endian_clouds_with_gaps_are_read():
    rows, columns = 3, 5
    points = np.arange(rows * columns * 3, dtype=np.float64).reshape(rows, columns, 3)
    points[1, 2] = np.nan
    data = np.zeros((rows, columns * 32 + 16), np.uint8)
    for row in range(rows):
        for column in range(columns):
            data[row, 32 * column + 8 : 32 * column + 32] = points[row, column].astype(">f8").view(np.uint8)
    fields = [SimpleNamespace(name=name, offset=8 + 8 * place, datatype=8, count=1) for place, name in enumerate("xyz")]
    cloud = SimpleNamespace(
        fields=fields, height=rows, width=columns, point_step=32, row_step=columns * 32 + 16, is_bigendian=True
    )
    cloud.data = data.tobytes()
    positions, _ = clouds.to_arrays(cloud)
    expected = points.reshape(-1, 3)
    np.testing.assert_array_equal(positions, expected[np.isfinite(expected).all(axis=1)])
