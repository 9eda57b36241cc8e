"""Stand-ins for rclpy, tf2_ros and the message packages, on DDS: the node runs on ROS 2's wire.

No proof of rclpy; but names, types, encodings and policies are those that a ROS 2 graph sees.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from types import ModuleType, SimpleNamespace
from typing import Any

from cyclonedds.idl import IdlStruct
from lineloom.bridge.dds import DdsWire
from lineloom.bridge.robot_bridge import NoTransformError
from lineloom.bridge.stamps import nanoseconds, set_stamp
from lineloom.bridge.transform_tree import TransformTree
from lineloom.bridge.wire_types import TYPES

PACKAGES = {
    "diagnostic_msgs": ("DiagnosticArray", "DiagnosticStatus", "KeyValue"),
    "geometry_msgs": ("Point", "PoseWithCovarianceStamped", "TransformStamped"),
    "nav_msgs": ("MapMetaData", "OccupancyGrid", "Odometry"),
    "sensor_msgs": ("LaserScan",),
    "std_msgs": ("ColorRGBA", "String"),
    "visualization_msgs": ("Marker",),
}
_KINDS = {"float32": float, "float64": float, "int32": int, "uint32": int, "int8": int}


def checked(message: Any) -> Any:
    """Return the message, or raise AssertionError as rosidl's setters do: an int is no float."""
    for field in fields(message):
        value = getattr(message, field.name)
        if isinstance(value, IdlStruct):
            checked(value)
        elif isinstance(value, list) and value and isinstance(value[0], IdlStruct):
            for item in value:
                checked(item)
        elif field.type is str:
            assert isinstance(value, str), f"{field.name} must be str, is {value!r}"
        elif field.name == "level":
            assert isinstance(value, bytes), "level must be bytes"
            setattr(message, field.name, value[0])
        else:
            names = [n for n in _KINDS if str(field.type).startswith(f"typing.Annotated[int, '{n}'")
                     or str(field.type).startswith(f"typing.Annotated[float, '{n}'")]  # fmt: skip
            for name in names:
                kind = _KINDS[name]
                assert isinstance(value, kind), f"{field.name} must be {kind}, is {value!r}"
    return message


class Time:
    """rclpy.time.Time."""

    def __init__(self, nanoseconds: int = 0) -> None:
        self.nanoseconds = nanoseconds

    @staticmethod
    def from_msg(stamp: Any) -> Time:
        return Time(nanoseconds(stamp))

    def to_msg(self) -> Any:
        stamp = TYPES.Time()
        set_stamp(stamp, self.nanoseconds)
        return stamp


class Logger:
    """Remembers what was said."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def warn(self, text: str) -> None:
        self.said.append(text)

    info = warn


class Node:
    """rclpy.node.Node. parameters, namespace, remaps, domain: what a launch file would set."""

    parameters: dict[str, Any] = {}  # noqa: RUF012
    namespace = ""
    remaps: dict[str, str] = {}  # noqa: RUF012
    domain = 0

    def __init__(self, name: str) -> None:
        self.name = name
        self.logger = Logger()
        self.wire = DdsWire(self.domain)
        self.timers_made: list[list[Any]] = []

    def declare_parameter(self, name: str, default: Any, descriptor: Any) -> Any:
        value = self.parameters.get(name, default)
        if type(value) is not type(default) and not descriptor.dynamic_typing:
            raise TypeError(f"{name} is {type(value).__name__}, not {type(default).__name__}")
        return SimpleNamespace(value=value)

    def create_publisher(self, kind: Any, topic: str, qos: Any) -> Any:
        write = self.wire.advertise(self.full(topic), kind, latched=qos.durability == 1)
        return SimpleNamespace(publish=lambda message: write(checked(message)))

    def create_subscription(self, kind: Any, topic: str, take: Any, qos: Any) -> None:
        latched = qos.durability == 1
        self.wire.listen(self.full(topic), kind, take, latched=latched, reliable=qos.reliable)

    def create_timer(self, period: float, callback: Callable[[], None]) -> None:
        self.timers_made.append([0.0, period, callback])

    def get_logger(self) -> Logger:
        return self.logger

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: Time(time.time_ns()))

    def full(self, topic: str) -> str:
        topic = self.remaps.get(topic, topic)
        return topic if topic.startswith("/") else f"{self.namespace}/{topic}"

    def turn(self) -> None:
        """Do what has come and what is due, as rclpy.spin_once."""
        self.wire.spin_once(0.005)
        for timer in self.timers_made:
            if time.monotonic() >= timer[0]:
                timer[0] = time.monotonic() + timer[1]
                timer[2]()


class QoSProfile:
    """rclpy.qos.QoSProfile."""

    def __init__(self, depth: int = 10, durability: int = 2, reliable: bool = True) -> None:
        self.depth, self.durability, self.reliable = depth, durability, reliable


class TransformError(Exception):
    """tf2_ros.TransformException."""


class Buffer:
    """tf2_ros.Buffer."""

    def __init__(self) -> None:
        self.tree = TransformTree()

    def lookup_transform(self, target: str, source: str, when: Time) -> Any:
        stamp = when.nanoseconds or None
        try:
            found = self.tree.lookup(target, source, stamp)
        except NoTransformError as error:
            raise TransformError(str(error)) from None
        transform = TYPES.Transform()
        for axis, value in zip("xyz", found.translation, strict=True):
            setattr(transform.translation, axis, value)
        for axis, value in zip("xyzw", found.rotation, strict=True):
            setattr(transform.rotation, axis, value)
        return SimpleNamespace(transform=transform)


class TransformListener:
    """tf2_ros.TransformListener."""

    def __init__(self, buffer: Buffer, node: Node) -> None:
        def take(message: Any, *, static: bool) -> None:
            for transform in message.transforms:
                buffer.tree.put(transform, static=static)

        def moving(message: Any) -> None:
            take(message, static=False)

        def fixed(message: Any) -> None:
            take(message, static=True)

        node.create_subscription(TYPES.TFMessage, "/tf", moving, QoSProfile(100))
        node.create_subscription(TYPES.TFMessage, "/tf_static", fixed, QoSProfile(100, 1))


class TransformBroadcaster:
    """tf2_ros.TransformBroadcaster."""

    def __init__(self, node: Node) -> None:
        self._sink = node.create_publisher(TYPES.TFMessage, "/tf", QoSProfile(100))

    def sendTransform(self, transform: Any) -> None:
        self._sink.publish(TYPES.TFMessage(transforms=[transform]))


@contextmanager
def installed(
    domain: int, namespace: str = "", remaps: dict[str, str] | None = None, **parameters: Any
) -> Iterator[None]:
    """Have the modules importable, as long as the block lasts."""
    Node.parameters, Node.domain, Node.namespace = parameters, domain, namespace
    Node.remaps = remaps or {}
    contents: dict[str, dict[str, Any]] = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "rclpy.time": {"Time": Time},
        "rclpy.qos": {
            "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL=1),
            "QoSProfile": QoSProfile,
            "qos_profile_sensor_data": QoSProfile(5, reliable=False),
        },
        "rcl_interfaces": {},
        "rcl_interfaces.msg": {"ParameterDescriptor": SimpleNamespace},
        "tf2_ros": {
            "Buffer": Buffer,
            "TransformBroadcaster": TransformBroadcaster,
            "TransformException": TransformError,
            "TransformListener": TransformListener,
        },
    }
    for package, names in PACKAGES.items():
        contents[package] = {}
        contents[f"{package}.msg"] = {name: getattr(TYPES, name) for name in names}
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
