"""The ROS 2 node: subscriptions, transforms and publishers, and nothing that could be elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import Point, TransformStamped
from lineloom import Client, Outbox
from lineloom.errors import LineloomError
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import LaserScan
from std_msgs.msg import ColorRGBA
from tf2_ros import Buffer, TransformBroadcaster, TransformException, TransformListener
from visualization_msgs.msg import Marker

from lineloom_bridge.lines import LineList
from lineloom_bridge.link import Handlers, Link, Wishes
from lineloom_bridge.localisation import MapTransform
from lineloom_bridge.occupancy import Grid
from lineloom_bridge.planar import Planar, TiltedLidarError, mount, planar
from lineloom_bridge.scan_feed import ScanFeed, seconds

_DEFAULTS: dict[str, Any] = {
    "url": "",
    "token": "",
    "site": "default",
    "robot": "robot",
    "queue": "",
    "map_frame": "map",
    "odom_frame": "odom",
    "base_frame": "base_link",
    "odometry": "tf",
    "publish_tf": True,
    "publish_grid": True,
    "publish_lines": True,
    "max_rate": 10.0,
    "pose_period": 0.5,
    "map_period": 5.0,
    "transform_tolerance": 0.2,
}
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_BROADCAST_S = 0.05
_LINE_WIDTH_M = 0.05


class Bridge(Node):
    """One robot's bridge."""

    def __init__(self) -> None:
        super().__init__("lineloom_bridge")
        values = {name: self.declare_parameter(name, v).value for name, v in _DEFAULTS.items()}
        self._set: dict[str, Any] = values
        self._client = Client(values["url"] or None, token=values["token"] or None)
        queue = values["queue"] or str(Path.home() / ".ros" / f"lineloom-{values['robot']}.db")
        Path(queue).parent.mkdir(parents=True, exist_ok=True)
        self._outbox = Outbox(queue, self._client, values["site"], values["robot"])
        self._feed = ScanFeed(self._outbox, values["max_rate"])
        self._buffer = Buffer()
        self._listener = TransformListener(self._buffer, self)
        self._broadcaster = TransformBroadcaster(self)
        self._odometry: Planar | None = None
        self._transform: MapTransform | None = None
        self._grids = self.create_publisher(OccupancyGrid, "map", _LATCHED)
        self._markers = self.create_publisher(Marker, "map_lines", _LATCHED)
        self.create_subscription(LaserScan, "scan", self._on_scan, qos_profile_sensor_data)
        if values["odometry"] == "topic":
            self.create_subscription(Odometry, "odom", self._on_odometry, qos_profile_sensor_data)
        self.create_timer(_BROADCAST_S, self._broadcast)
        self._link = self._make_link()
        self._outbox.start()
        self._link.start()

    def close(self) -> None:
        """Stop asking; what was not delivered stays in the queue's file."""
        self._link.close()
        self._outbox.close()
        self._client.close()

    def _make_link(self) -> Link:
        wishes = Wishes(
            self._set["pose_period"],
            self._set["map_period"],
            self._set["publish_grid"],
            self._set["publish_lines"],
        )
        handlers = Handlers(self._keep, self._show_grid, self._show_lines, self.get_logger().warn)
        site, robot = self._set["site"], self._set["robot"]
        return Link(self._client, site, robot, self._feed, wishes, handlers)

    def _on_odometry(self, message: Any) -> None:
        pose = message.pose.pose
        self._odometry = planar(pose.position, pose.orientation)

    def _on_scan(self, message: Any) -> None:
        if not self._feed.wants(seconds(message.header.stamp)):
            return
        if not self._link.mounted:
            self._offer_mount(message.header.frame_id)
            return
        try:
            self._feed.put(message, self._odometry_at(message.header.stamp))
        except LineloomError as error:
            self.get_logger().error(f"scan left out: {error}", throttle_duration_sec=5.0)

    def _odometry_at(self, stamp: Any) -> Planar | None:
        if self._set["odometry"] != "tf":
            return self._odometry
        frames = (self._set["odom_frame"], self._set["base_frame"])
        try:
            found = self._buffer.lookup_transform(*frames, Time.from_msg(stamp)).transform
        except TransformException:
            return None
        return planar(found.translation, found.rotation)

    def _offer_mount(self, laser_frame: str) -> None:
        """Have the service told how the lidar sits; no scan goes out before it knows."""
        try:
            base = self._set["base_frame"]
            found = self._buffer.lookup_transform(base, laser_frame, Time()).transform
            self._link.offer_mount(mount(found.translation, found.rotation))
        except (TransformException, TiltedLidarError) as error:
            self.get_logger().warn(f"no scans yet: {error}", throttle_duration_sec=5.0)

    def _keep(self, found: MapTransform) -> None:
        self._transform = found

    def _broadcast(self) -> None:
        found = self._transform
        if found is None or not self._set["publish_tf"]:
            return
        ahead = Duration(seconds=self._set["transform_tolerance"])
        message = TransformStamped()
        message.header.stamp = (self.get_clock().now() + ahead).to_msg()
        message.header.frame_id = self._set["map_frame"]
        message.child_frame_id = self._set["base_frame" if found.to_base else "odom_frame"]
        message.transform.translation.x = found.T.x
        message.transform.translation.y = found.T.y
        q = message.transform.rotation
        q.x, q.y, q.z, q.w = found.T.quaternion
        self._broadcaster.sendTransform(message)

    def _show_grid(self, grid: Grid) -> None:
        message = OccupancyGrid()
        message.header.frame_id = self._set["map_frame"]
        message.header.stamp = self.get_clock().now().to_msg()
        message.info.resolution = grid.resolution
        message.info.width, message.info.height = grid.width, grid.height
        message.info.origin.position.x = grid.x
        message.info.origin.position.y = grid.y
        message.info.origin.orientation.w = 1.0
        message.data = grid.data
        self._grids.publish(message)

    def _show_lines(self, lines: LineList) -> None:
        message = Marker()
        message.header.frame_id = self._set["map_frame"]
        message.header.stamp = self.get_clock().now().to_msg()
        message.ns, message.id = "lineloom", 0
        message.type, message.action = Marker.LINE_LIST, Marker.ADD
        message.scale.x = _LINE_WIDTH_M
        message.pose.orientation.w = 1.0
        message.points = [Point(x=x, y=y, z=0.0) for x, y in lines.points]
        message.colors = [ColorRGBA(r=r, g=g, b=b, a=a) for r, g, b, a in lines.colours]
        self._markers.publish(message)


def main() -> None:
    """Run the node until Ctrl-C."""
    rclpy.init()
    node = Bridge()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.close()
        node.destroy_node()
        rclpy.try_shutdown()
