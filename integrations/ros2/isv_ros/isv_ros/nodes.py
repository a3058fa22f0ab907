"""The nodes: a cloud goes in at one place, and comes out at another over a topic of compressed messages."""

from __future__ import annotations

from array import array

import isv
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import UInt8MultiArray

from . import clouds
from .messages import Arrived, Receiver, Sender

_SECOND_NS = 1_000_000_000


class CloudSender(Node):
    """Subscribes to ``cloud``, publishes ``isv``. ROS has Z up, which the stream is told."""

    def __init__(self) -> None:
        """Declare the parameters and connect the topics."""
        super().__init__("send_cloud")
        voxel = self.declare_parameter("voxel", 0.05).value
        gop = self.declare_parameter("gop", 30).value
        quality = self.declare_parameter("quality", 50.0).value
        self._sender = Sender(voxel=voxel, gop=gop, quality=quality, up="z", estimate_normals=True)
        reliable = QoSProfile(depth=gop, reliability=ReliabilityPolicy.RELIABLE)
        self._publisher = self.create_publisher(UInt8MultiArray, "isv", reliable)
        # Drivers of sensors mostly publish so, which those who ask for more do not receive.
        latest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(PointCloud2, "cloud", self._on_cloud, latest)

    def _on_cloud(self, cloud: PointCloud2) -> None:
        try:
            positions, colours = clouds.to_arrays(cloud)
            stamp = cloud.header.stamp
            stamp_ns = stamp.sec * _SECOND_NS + stamp.nanosec
            data = self._sender.push(isv.Points(positions, None, colours), stamp_ns, cloud.header.frame_id)
        except ValueError as error:
            self.get_logger().warning(f"cloud left out: {error}")
            return
        self._publisher.publish(UInt8MultiArray(data=array("B", data)))


class CloudReceiver(Node):
    """Subscribes to ``isv``, publishes ``cloud``: each with the stamp and the frame of the cloud that was sent."""

    def __init__(self) -> None:
        """Declare the parameters and connect the topics."""
        super().__init__("receive_cloud")
        self._frame_id = self.declare_parameter("frame_id", "").value
        self._receiver = Receiver()
        self._publisher = self.create_publisher(PointCloud2, "cloud", 1)
        reliable = QoSProfile(depth=30, reliability=ReliabilityPolicy.RELIABLE)
        self.create_subscription(UInt8MultiArray, "isv", self._on_message, reliable)

    def _on_message(self, message: UInt8MultiArray) -> None:
        try:
            received = self._receiver.push(bytes(message.data))
        except ValueError as error:
            self.get_logger().warning(f"message left out: {error}")
            return
        for arrived in received:
            self._publish(arrived)

    def _publish(self, arrived: Arrived) -> None:
        points = arrived.frame.points()
        # Y up becomes Z up again.
        positions = points.positions[:, [0, 2, 1]]
        positions[:, 1] *= -1
        cloud = PointCloud2()
        cloud.header.frame_id = self._frame_id or arrived.frame_id
        cloud.header.stamp.sec, cloud.header.stamp.nanosec = divmod(arrived.stamp_ns, _SECOND_NS)
        cloud.height, cloud.width = 1, len(positions)
        cloud.fields = [
            PointField(name=name, offset=offset, datatype=datatype, count=count)
            for name, offset, datatype, count in clouds.layout(points.colors is not None)
        ]
        cloud.point_step = 4 * len(cloud.fields)
        cloud.row_step = cloud.point_step * cloud.width
        cloud.is_dense = True
        cloud.data = array("B", clouds.to_bytes(positions, points.colors))
        self._publisher.publish(cloud)


def _spin(make: type[Node]) -> None:
    rclpy.init()
    try:
        rclpy.spin(make())
    except KeyboardInterrupt:
        pass
    finally:
        rclpy.try_shutdown()


def send_cloud() -> None:
    """Run the sender."""
    _spin(CloudSender)


def receive_cloud() -> None:
    """Run the receiver."""
    _spin(CloudReceiver)
