"""The nodes with stand-ins for ROS: what they subscribe to, and what comes out."""

import sys
from types import ModuleType, SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from isv_ros import clouds


class Message(SimpleNamespace):
    """A message with any fields."""

    def __getattr__(self, name):
        value = Message()
        setattr(self, name, value)
        return value


class Node:
    """What the nodes use of rclpy's."""

    def __init__(self, name):
        self.published, self.subscriptions, self.warnings, self.qualities = [], {}, [], {}

    parameters: ClassVar = {"voxel": 0.02}

    def declare_parameter(self, name, value):
        return SimpleNamespace(value=self.parameters.get(name, value))

    def create_publisher(self, kind, topic, quality):
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, kind, topic, receive, quality):
        self.subscriptions[topic] = receive
        self.qualities[topic] = quality

    def get_logger(self):
        return SimpleNamespace(warning=self.warnings.append)


@pytest.fixture
def nodes(monkeypatch):
    """The module of the nodes, on stand-ins."""
    stand_ins = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {"QoSProfile": dict, "ReliabilityPolicy": SimpleNamespace(RELIABLE=1, BEST_EFFORT=2)},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"PointCloud2": Message, "PointField": Message},
        "std_msgs": {},
        "std_msgs.msg": {"UInt8MultiArray": Message},
    }
    for name, contents in stand_ins.items():
        module = ModuleType(name)
        vars(module).update(contents)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "isv_ros.nodes", raising=False)
    import isv_ros.nodes

    return isv_ros.nodes


def cloud(positions, colours):
    """A cloud as ROS has it, as it was seen 12.3 s after the beginning by the frame lidar."""
    header = Message(stamp=Message(sec=12, nanosec=300_000_000), frame_id="lidar")
    fields = [Message(name=n, offset=o, datatype=d, count=c) for n, o, d, c in clouds.layout(colours is not None)]
    step = 4 * len(fields)
    count = len(positions)
    data = clouds.to_bytes(positions, colours)
    return Message(
        header=header,
        fields=fields,
        height=1,
        width=count,
        point_step=step,
        row_step=step * count,
        is_bigendian=False,
        data=data,
    )


def test_a_cloud_comes_out_where_it_was_and_in_its_colours(nodes):
    sender, receiver = nodes.CloudSender(), nodes.CloudReceiver()
    assert sender.qualities["cloud"]["reliability"] == 2, "what publishes reliably is received too"
    directions = np.random.default_rng(1).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    positions = (0.3 * directions + [1.0, 2.0, 3.0]).astype(np.float32)
    sender.subscriptions["cloud"](cloud(positions, np.full(positions.shape, [20, 180, 60], np.uint8)))
    (message,) = sender.published
    receiver.subscriptions["isv"](message)
    (received,) = receiver.published
    found, colours = clouds.to_arrays(Message(**vars(received), is_bigendian=False))
    np.testing.assert_allclose((found.min(axis=0) + found.max(axis=0)) / 2, [1, 2, 3], atol=0.02)
    np.testing.assert_allclose(np.median(colours, axis=0), [20, 180, 60], atol=6)
    header = received.header
    assert (header.frame_id, header.stamp.sec, header.stamp.nanosec) == ("lidar", 12, 300_000_000)
    assert not sender.warnings and not receiver.warnings


def test_a_receiver_can_name_another_frame(nodes, monkeypatch):
    monkeypatch.setitem(Node.parameters, "frame_id", "odom")
    sender, receiver = nodes.CloudSender(), nodes.CloudReceiver()
    positions = np.random.default_rng(1).normal(size=(20_000, 3)).astype(np.float32)
    positions /= np.linalg.norm(positions, axis=1)[:, None]
    sender.subscriptions["cloud"](cloud(0.3 * positions, None))
    receiver.subscriptions["isv"](*sender.published)
    (received,) = receiver.published
    assert received.header.frame_id == "odom"


def test_what_cannot_be_used_is_a_warning(nodes):
    sender, receiver = nodes.CloudSender(), nodes.CloudReceiver()
    sender.subscriptions["cloud"](Message(fields=[]))
    receiver.subscriptions["isv"](Message(data=b"1234"))
    assert len(sender.warnings) == 1 and len(receiver.warnings) == 1
    assert not sender.published and not receiver.published
