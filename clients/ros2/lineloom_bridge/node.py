"""The ROS 2 node: carries messages between rclpy and the bridge, and nothing that is elsewhere."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, PoseWithCovarianceStamped, TransformStamped
from lineloom.bridge.robot_bridge import NoTransformError, RobotBridge
from lineloom.bridge.settings import DEFAULTS, read_settings
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import LaserScan
from std_msgs.msg import ColorRGBA, String
from tf2_ros import Buffer, TransformBroadcaster, TransformException, TransformListener
from visualization_msgs.msg import Marker

TYPES = SimpleNamespace(
    ColorRGBA=ColorRGBA,
    DiagnosticArray=DiagnosticArray,
    DiagnosticStatus=DiagnosticStatus,
    KeyValue=KeyValue,
    MapMetaData=MapMetaData,
    Marker=Marker,
    OccupancyGrid=OccupancyGrid,
    Point=Point,
    PoseWithCovarianceStamped=PoseWithCovarianceStamped,
    String=String,
    TransformStamped=TransformStamped,
    level=lambda number: bytes([number]),
)
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_PLAIN = QoSProfile(depth=10)
_PUBLISHED: dict[str, tuple[Any, str, Any]] = {
    "pose": (PoseWithCovarianceStamped, "pose", _PLAIN),
    "map": (OccupancyGrid, "map", _LATCHED),
    "map_metadata": (MapMetaData, "map_metadata", _LATCHED),
    "map_lines": (Marker, "map_lines", _LATCHED),
    "component": (String, "component", _LATCHED),
    "diagnostics": (DiagnosticArray, "/diagnostics", _PLAIN),
}
_TICK_S = 0.02


class Bridge(Node):
    """One robot's bridge."""

    types = TYPES

    def __init__(self) -> None:
        super().__init__("lineloom_bridge")
        self._buffer = Buffer()
        self._listener = TransformListener(self._buffer, self)
        self._broadcaster = TransformBroadcaster(self)
        self._sinks = {
            name: self.create_publisher(kind, topic, qos)
            for name, (kind, topic, qos) in _PUBLISHED.items()
        }
        self.settings = read_settings({name: self._parameter(name) for name in DEFAULTS})
        self.bridge = RobotBridge(self.settings, self)
        scans = self.bridge.on_scan
        self.create_subscription(LaserScan, "scan", scans, qos_profile_sensor_data)
        if self.settings.odometry == "topic":
            odometry = self.bridge.on_odometry
            self.create_subscription(Odometry, "odom", odometry, qos_profile_sensor_data)
        self.create_timer(_TICK_S, self.bridge.tick)
        self.bridge.start()

    def close(self) -> None:
        """Stop; what was not delivered stays in the queue's file."""
        self.bridge.close()

    def now(self) -> int:
        """Return the node's time, simulated with use_sim_time [ns]."""
        return int(self.get_clock().now().nanoseconds)

    def lookup(self, target: str, source: str, stamp: Any) -> Any:
        """Ask TF, at a stamp or for the latest where that is None. Raises NoTransformError."""
        when = Time() if stamp is None else Time.from_msg(stamp)
        try:
            return self._buffer.lookup_transform(target, source, when).transform
        except TransformException as error:
            raise NoTransformError(str(error)) from None

    def publish(self, topic: str, message: Any) -> None:
        """Send one of the bridge's messages."""
        if topic == "tf":
            self._broadcaster.sendTransform(message)
        else:
            self._sinks[topic].publish(message)

    def say(self, level: str, text: str) -> None:
        """Log."""
        if level == "warn":
            self.get_logger().warn(text)
        else:
            self.get_logger().info(text)

    def _parameter(self, name: str) -> Any:
        # Of any type: `-p robot:=7` is a number to the command line, and a name to us.
        descriptor = ParameterDescriptor(dynamic_typing=True)
        return self.declare_parameter(name, DEFAULTS[name], descriptor).value


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
