"""Small bags, written by rosbags itself: two robots, mounts, odometry."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

Kind = Literal["ros1", "sqlite", "mcap", "lone mcap"]
KINDS: tuple[Kind, ...] = ("ros1", "sqlite", "mcap", "lone mcap")

SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
TRANSFORMS = "tf2_msgs/msg/TFMessage"

Entry = tuple[str, str, float, Any]
"""Topic, type, stamp [s], message."""


def store_of(kind: Kind) -> Typestore:
    """Return the messages of a generation; those of ROS 1 lack TFMessage."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    if kind == "ros1":
        definition = "geometry_msgs/TransformStamped[] transforms"
        store.register(get_types_from_msg(definition, TRANSFORMS))
    return store


class Messages:
    """Makes messages of one generation of ROS."""

    def __init__(self, kind: Kind) -> None:
        self.ros1 = kind == "ros1"
        self.store = store_of(kind)
        self.types: dict[str, Any] = dict(self.store.types)

    def _header(self, stamp: float, frame: str) -> Any:
        nanoseconds = round(stamp * 1e9)
        time = self.types["builtin_interfaces/msg/Time"](nanoseconds // 10**9, nanoseconds % 10**9)
        header = self.types["std_msgs/msg/Header"]
        return header(0, time, frame) if self.ros1 else header(time, frame)

    def scan(self, stamp: float, frame: str, ranges: Iterable[float], **changes: Any) -> Any:
        values = np.array(list(ranges), dtype=np.float32)
        fields: dict[str, Any] = {
            "angle_min": -1.0,
            "angle_max": 1.0,
            "angle_increment": 2.0 / max(len(values) - 1, 1),
            "time_increment": 0.0,
            "scan_time": 0.1,
            "range_min": 0.1,
            "range_max": 30.0,
        }
        return self.types["sensor_msgs/msg/LaserScan"](
            header=self._header(stamp, frame),
            ranges=values,
            intensities=np.empty(0, np.float32),
            **(fields | changes),
        )

    def odometry(self, stamp: float, x: float, y: float, yaw: float) -> Any:
        t = self.types
        pose = t["geometry_msgs/msg/Pose"](
            t["geometry_msgs/msg/Point"](x, y, 0.0), self._turn(yaw, 0.0)
        )
        zero = t["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        twist = t["geometry_msgs/msg/Twist"](zero, zero)
        return t["nav_msgs/msg/Odometry"](
            self._header(stamp, "odom"),
            "base_link",
            t["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
            t["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
        )

    def transform(
        self,
        stamp: float,
        parent: str,
        child: str,
        x: float,
        y: float,
        yaw: float,
        roll: float = 0.0,
    ) -> Any:
        t = self.types
        T = t["geometry_msgs/msg/Transform"](
            t["geometry_msgs/msg/Vector3"](x, y, 0.2), self._turn(yaw, roll)
        )
        stamped = t["geometry_msgs/msg/TransformStamped"](self._header(stamp, parent), child, T)
        return t["tf2_msgs/msg/TFMessage"]([stamped])

    def _turn(self, yaw: float, roll: float) -> Any:
        """Return Rz(yaw) Rx(roll) as a quaternion."""
        c, s, a, b = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(roll / 2), math.sin(roll / 2)
        return self.types["geometry_msgs/msg/Quaternion"](c * b, s * b, s * a, c * a)


def write_bag(folder: Path, kind: Kind, entries: Iterable[Entry]) -> Path:
    """Write entries in order; return what a reader is to be given."""
    path = folder / ("run.bag" if kind == "ros1" else "run")
    store = store_of(kind)
    if kind == "ros1":
        writer: Any = Writer1(path)
        pack: Any = store.serialize_ros1
    else:
        plugin = StoragePlugin.SQLITE3 if kind == "sqlite" else StoragePlugin.MCAP
        writer = Writer2(path, version=9, storage_plugin=plugin)
        pack = store.serialize_cdr
    connections: dict[str, Any] = {}
    with writer:
        for topic, kind_of, stamp, message in entries:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind_of, typestore=store)
            writer.write(connections[topic], round(stamp * 1e9), pack(message, kind_of))
    return next(path.glob("*.mcap")) if kind == "lone mcap" else path
