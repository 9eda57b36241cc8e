"""The ROS 2 messages that a bridge needs, as types of Cyclone DDS: read and written as Humble and
later do (plain CDR). Needs the extra `dds` or `zenoh`."""

from __future__ import annotations

import types as python_types
from dataclasses import dataclass, field
from typing import Any

from cyclonedds.idl import IdlStruct
from cyclonedds.idl import annotations as idl_annotations
from cyclonedds.idl import types as _idl_types

idl: Any = _idl_types

_DEFINITIONS = """
builtin_interfaces/Time: int32 sec, uint32 nanosec
builtin_interfaces/Duration: int32 sec, uint32 nanosec
std_msgs/Header: Time stamp, string frame_id
std_msgs/String: string data
std_msgs/ColorRGBA: float32 r, float32 g, float32 b, float32 a
geometry_msgs/Point: float64 x, float64 y, float64 z
geometry_msgs/Vector3: float64 x, float64 y, float64 z
geometry_msgs/Quaternion: float64 x, float64 y, float64 z, float64 w
geometry_msgs/Pose: Point position, Quaternion orientation
geometry_msgs/PoseWithCovariance: Pose pose, float64[36] covariance
geometry_msgs/PoseWithCovarianceStamped: Header header, PoseWithCovariance pose
geometry_msgs/Twist: Vector3 linear, Vector3 angular
geometry_msgs/TwistWithCovariance: Twist twist, float64[36] covariance
geometry_msgs/Transform: Vector3 translation, Quaternion rotation
geometry_msgs/TransformStamped: Header header, string child_frame_id, Transform transform
tf2_msgs/TFMessage: TransformStamped[] transforms
sensor_msgs/LaserScan: Header header, float32 angle_min, float32 angle_max, \
float32 angle_increment, float32 time_increment, float32 scan_time, float32 range_min, \
float32 range_max, float32[] ranges, float32[] intensities
sensor_msgs/CompressedImage: Header header, string format, uint8[] data
nav_msgs/Odometry: Header header, string child_frame_id, PoseWithCovariance pose, \
TwistWithCovariance twist
nav_msgs/MapMetaData: Time map_load_time, float32 resolution, uint32 width, uint32 height, \
Pose origin
nav_msgs/OccupancyGrid: Header header, MapMetaData info, int8[] data
visualization_msgs/UVCoordinate: float32 u, float32 v
visualization_msgs/MeshFile: string filename, uint8[] data
visualization_msgs/Marker: Header header, string ns, int32 id, int32 type, int32 action, \
Pose pose, Vector3 scale, ColorRGBA color, Duration lifetime, bool frame_locked, Point[] points, \
ColorRGBA[] colors, string texture_resource, CompressedImage texture, \
UVCoordinate[] uv_coordinates, string text, string mesh_resource, MeshFile mesh_file, \
bool mesh_use_embedded_materials
diagnostic_msgs/KeyValue: string key, string value
diagnostic_msgs/DiagnosticStatus: uint8 level, string name, string message, string hardware_id, \
KeyValue[] values
diagnostic_msgs/DiagnosticArray: Header header, DiagnosticStatus[] status
"""
_PLAIN: dict[str, tuple[Any, Any]] = {
    "bool": (bool, False),
    "string": (str, ""),
    "float32": (idl.float32, 0.0),
    "float64": (idl.float64, 0.0),
    "int8": (idl.int8, 0),
    "uint8": (idl.uint8, 0),
    "int32": (idl.int32, 0),
    "uint32": (idl.uint32, 0),
}
"""By name: the type, and the value of a new message."""

_ROS_NAMES: dict[str, str] = {}


def _declare(text: str, known: dict[str, Any]) -> Any:
    """Make the class of one definition; known: those before it, by name."""
    name, _, members = text.partition(": ")
    package, short = name.split("/")
    annotations: dict[str, Any] = {}
    values: dict[str, Any] = {}
    for member in members.split(", "):
        kind, title = member.split(" ")
        annotations[title], values[title] = _member(kind, known)

    def fill(namespace: dict[str, Any]) -> None:
        namespace.update(values)
        namespace["__annotations__"] = annotations
        namespace["__module__"] = __name__

    typename = f"{package}.msg.dds_.{short}_"
    made = python_types.new_class(short, (IdlStruct,), {"typename": typename}, fill)
    _ROS_NAMES[short] = f"{package}/msg/{short}"
    return idl_annotations.final(dataclass(made))


def _member(kind: str, known: dict[str, Any]) -> tuple[Any, Any]:
    """Return the type of a member, and its value in a new message."""
    base, bracket, size = kind.partition("[")
    element = _PLAIN[base][0] if base in _PLAIN else known[base]
    if not bracket:
        return (element, _PLAIN[base][1]) if base in _PLAIN else (element, _fresh(element))
    if size == "]":
        return idl.sequence[element], field(default_factory=list)
    count = int(size.rstrip("]"))
    return idl.array[element, count], field(default_factory=lambda: [0.0] * count)


def _fresh(made: Any) -> Any:
    if made.__name__ == "Quaternion":  # no turn
        return field(default_factory=lambda: made(w=1.0))
    return field(default_factory=made)


def _all() -> dict[str, Any]:
    known: dict[str, Any] = {}
    for text in _DEFINITIONS.strip().splitlines():
        made = _declare(text, known)
        known[made.__name__] = made
    known["Marker"].LINE_LIST, known["Marker"].ADD = 5, 0
    known["level"] = int
    return known


TYPES: Any = python_types.SimpleNamespace(**_all())
"""The classes by their short names, as `lineloom.bridge.messages` wants them."""


def ros_name(kind: Any) -> str:
    """Return a type's name as ROS writes it: sensor_msgs/msg/LaserScan."""
    return _ROS_NAMES[kind.__name__]
