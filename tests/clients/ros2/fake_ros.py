"""Stand-ins for the parts of ROS 2 that the node uses: enough to run it, no proof of ROS."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType, SimpleNamespace
from typing import Any


class Message:
    """A message whose fields come into being when they are touched, as nested messages."""

    def __init__(self, **fields: Any) -> None:
        self.__dict__.update(fields)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        value = self.__dict__[name] = Message()
        return value


class Marker(Message):
    """A marker with its constants."""

    LINE_LIST = 5
    ADD = 0


class TransformError(Exception):
    """tf2_ros.TransformException."""


class Buffer:
    """Transforms by (target, source); set by the test."""

    known: dict[tuple[str, str], Any]

    def __init__(self) -> None:
        self.known = {}

    def lookup_transform(self, target: str, source: str, time: Any) -> Any:
        if (target, source) not in self.known:
            raise TransformError(f"no transform from {source} to {target}")
        return SimpleNamespace(transform=self.known[target, source])


class Time:
    """rclpy.time.Time."""

    def __init__(self, at: float = 0.0) -> None:
        self.at = at

    @staticmethod
    def from_msg(stamp: Any) -> Time:
        return Time(stamp.sec + 1e-9 * stamp.nanosec)

    def __add__(self, duration: Any) -> Time:
        return Time(self.at + duration.seconds)

    def to_msg(self) -> float:
        return self.at


class Sink:
    """A publisher or broadcaster that remembers."""

    def __init__(self, *_: Any) -> None:
        self.sent: list[Any] = []

    def publish(self, message: Any) -> None:
        self.sent.append(message)

    sendTransform = publish


class Logger:
    """Remembers what was said."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def warn(self, text: str, **_: Any) -> None:
        self.said.append(text)

    error = info = warn


class Node:
    """rclpy.node.Node. parameters: what a launch file would have set."""

    parameters: dict[str, Any] = {}  # noqa: RUF012

    def __init__(self, name: str) -> None:
        self.name = name
        self.logger = Logger()
        self.publishers_by_topic: dict[str, Sink] = {}
        self.callbacks: dict[str, Callable[[Any], None]] = {}
        self.timers_made: list[Callable[[], None]] = []

    def declare_parameter(self, name: str, default: Any) -> Any:
        return SimpleNamespace(value=self.parameters.get(name, default))

    def create_publisher(self, _: Any, topic: str, __: Any) -> Sink:
        return self.publishers_by_topic.setdefault(topic, Sink())

    def create_subscription(self, _: Any, topic: str, callback: Any, __: Any) -> None:
        self.callbacks[topic] = callback

    def create_timer(self, _: float, callback: Callable[[], None]) -> None:
        self.timers_made.append(callback)

    def get_logger(self) -> Logger:
        return self.logger

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: Time(100.0))


@contextmanager
def installed(**parameters: Any) -> Iterator[None]:
    """Have the modules importable, as long as the block lasts."""
    Node.parameters = parameters
    contents: dict[str, dict[str, Any]] = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "rclpy.duration": {"Duration": SimpleNamespace},
        "rclpy.time": {"Time": Time},
        "rclpy.qos": {
            "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL=1),
            "QoSProfile": SimpleNamespace,
            "qos_profile_sensor_data": None,
        },
        "geometry_msgs.msg": {"Point": Message, "TransformStamped": Message},
        "nav_msgs.msg": {"OccupancyGrid": Message, "Odometry": Message},
        "sensor_msgs.msg": {"LaserScan": Message},
        "std_msgs.msg": {"ColorRGBA": Message},
        "visualization_msgs.msg": {"Marker": Marker},
        "tf2_ros": {
            "Buffer": Buffer,
            "TransformBroadcaster": Sink,
            "TransformException": TransformError,
            "TransformListener": Sink,
        },
    }
    for name in ("geometry_msgs", "nav_msgs", "sensor_msgs", "std_msgs", "visualization_msgs"):
        contents[name] = {}
    before = set(sys.modules)
    for name, members in contents.items():
        module = ModuleType(name)
        module.__dict__.update(members)
        sys.modules[name] = module
    try:
        yield
    finally:
        for name in {*contents, "lineloom_bridge.node"} - before:
            sys.modules.pop(name, None)
