"""What else is on a robot's graph: its drivers, and somebody who reads every byte."""

from __future__ import annotations

import itertools
import math
import os
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

from cyclonedds._clayer import ddspy_take
from cyclonedds.core import InstanceState, SampleState, ViewState
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from lineloom.bridge.dds import DdsWire, qos
from lineloom.bridge.planar import Planar
from lineloom.bridge.stamps import SECOND, set_stamp
from lineloom.bridge.wire_types import TYPES, ros_name
from rosbags.typesys import Stores, get_typestore

LOOPBACK = (
    "<CycloneDDS><Domain><General><AllowMulticast>true</AllowMulticast><Interfaces>"
    "<NetworkInterface name='lo' multicast='true'/></Interfaces></General></Domain></CycloneDDS>"
)
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any
_RELEASES = [get_typestore(store) for store in (Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY)]


_COUNT = itertools.count()


def own_domain() -> int:
    """Return a domain that nobody else on this machine is likely to be on: latched messages stay
    until the process ends."""
    return 20 + (16 * os.getpid() + next(_COUNT)) % 200


def stamped(message: Any, at: float, frame: str) -> Any:
    """Return a message with its header filled in."""
    set_stamp(message.header.stamp, round(at * 1e3) * (SECOND // 1000))
    message.header.frame_id = frame
    return message


class Drivers:
    """A robot's lidar, odometry and TF."""

    def __init__(self, domain: int, namespace: str = "", tf: str = "", prefix: str = "") -> None:
        self.wire = DdsWire(domain)
        self.prefix = prefix
        advertise = self.wire.advertise
        self._scan = advertise(f"{namespace}/scan", TYPES.LaserScan, latched=False)
        self._odom = advertise(f"{namespace}/odom", TYPES.Odometry, latched=False)
        self._tf = advertise(f"{tf}/tf", TYPES.TFMessage, latched=False)
        self._tf_static = advertise(f"{tf}/tf_static", TYPES.TFMessage, latched=True)

    def mount(self, x: float = 0.3) -> None:
        """Say where the lidar is: turned by a quarter."""
        message = self._transform(0.0, "base_link", "laser", Planar(x, 0.0, math.pi / 2))
        self._tf_static(TYPES.TFMessage(transforms=[message]))

    def scan(self, at: float, ranges: list[float] | None = None) -> None:
        """Send a scan."""
        message = stamped(TYPES.LaserScan(), at, f"{self.prefix}laser")
        message.ranges = [1.0 + 0.1 * math.sin(at), 2.0, 3.0] if ranges is None else ranges
        message.angle_min, message.angle_increment = -1.0, 2.0 / max(1, len(message.ranges) - 1)
        message.range_min, message.range_max = 0.1, 30.0
        self._scan(message)

    def odom_tf(self, at: float, pose: Planar) -> None:
        """Say where odometry has the base, on /tf."""
        message = self._transform(at, "odom", "base_link", pose)
        self._tf(TYPES.TFMessage(transforms=[message]))

    def odom(self, at: float, pose: Planar) -> None:
        """Say where odometry has the base, on odom."""
        message = stamped(TYPES.Odometry(), at, f"{self.prefix}odom")
        message.child_frame_id = f"{self.prefix}base_link"
        message.pose.pose.position.x, message.pose.pose.position.y = pose.x, pose.y
        turn = message.pose.pose.orientation
        turn.x, turn.y, turn.z, turn.w = pose.quaternion
        self._odom(message)

    def _transform(self, at: float, parent: str, child: str, pose: Planar) -> Any:
        message = stamped(TYPES.TransformStamped(), at, self.prefix + parent)
        message.child_frame_id = self.prefix + child
        message.transform.translation.x, message.transform.translation.y = pose.x, pose.y
        turn = message.transform.rotation
        turn.x, turn.y, turn.z, turn.w = pose.quaternion
        return message


class Listener:
    """Takes topics as bytes, and reads them as Humble and as Jazzy do, not as we do."""

    def __init__(self, domain: int) -> None:
        self._participant = DomainParticipant(domain)
        self._readers: list[tuple[str, str, Any]] = []
        self.heard: dict[str, list[Any]] = defaultdict(list)

    def listen(self, topic: str, kind: Any, *, latched: bool = False) -> None:
        """Begin to take a topic."""
        policies = qos(latched=latched, reliable=True, depth=1000)
        named = Topic(self._participant, f"rt{topic}", kind)
        reader = DataReader(self._participant, named, qos=policies)
        self._readers.append((topic, ros_name(kind), reader))

    def take(self) -> None:
        """Read what has come. Each must come out the same bytes when it is written again."""
        for topic, name, reader in self._readers:
            for content, info in ddspy_take(reader._ref, _ANY, 100):
                if not info.valid_data:
                    continue
                for release in _RELEASES:
                    message = release.deserialize_cdr(content, name)
                    again = bytes(release.serialize_cdr(message, name))
                    # After the encapsulation's header, and before up to three bytes of padding.
                    assert content[4 : len(again)] == again[4:], topic
                    assert content[len(again) :] in (b"", b"\0", b"\0\0", b"\0\0\0"), topic
                self.heard[topic].append(message)

    def transforms(self, parent: str, topic: str = "/tf") -> list[Any]:
        """Return the transforms heard whose parent it is."""
        all_of = [t for message in self.heard[topic] for t in message.transforms]
        return [t for t in all_of if t.header.frame_id == parent]


def until(condition: Callable[[], Any], *turns: Callable[[], Any], within: float = 90.0) -> None:
    """Turn everybody's crank until something holds."""
    deadline = time.monotonic() + within
    while not condition():
        assert time.monotonic() < deadline, "nothing came"
        for turn in turns:
            turn()


def for_a_while(seconds: float, *turns: Callable[[], Any]) -> None:
    """Turn everybody's crank for so long."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for turn in turns:
            turn()
