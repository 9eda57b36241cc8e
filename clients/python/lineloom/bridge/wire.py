"""A bridge without ROS: its ports on a wire that carries ROS 2's messages, DDS or Zenoh."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Protocol

from lineloom.bridge.robot_bridge import RobotBridge
from lineloom.bridge.settings import BridgeSettings
from lineloom.bridge.stamps import nanoseconds
from lineloom.bridge.transform_tree import TransformTree
from lineloom.bridge.wire_types import TYPES

_TICK_S = 0.02


class Wire(Protocol):
    """What carries messages under ROS's topic names, e.g. /r1/scan."""

    def advertise(self, topic: str, kind: Any, *, latched: bool) -> Callable[[Any], None]:
        """Return what publishes a message of a kind; latched: who comes later gets the latest."""

    def listen(
        self, topic: str, kind: Any, take: Callable[[Any], None], *, latched: bool, reliable: bool
    ) -> None:
        """Have messages handed on by `spin_once`."""

    def spin_once(self, timeout: float) -> None:
        """Hand on what has come, waiting for something for so long at most [s]."""

    def close(self) -> None:
        """Leave."""


class WirePorts:
    """The bridge's ports. namespace: of all topics but /diagnostics, of TF's unless `shared_tf`."""

    types = TYPES

    def __init__(self, wire: Wire, namespace: str = "", *, shared_tf: bool = False) -> None:
        self._wire = wire
        self._namespace = "/" + namespace.strip("/") if namespace.strip("/") else ""
        self._tree = TransformTree()
        tf = "" if shared_tf else self._namespace
        send_tf = wire.advertise(f"{tf}/tf", TYPES.TFMessage, latched=False)
        self._sinks: dict[str, Callable[[Any], None]] = {
            "tf": lambda message: send_tf(TYPES.TFMessage(transforms=[message])),
            "pose": self._sink("pose", TYPES.PoseWithCovarianceStamped),
            "map": self._sink("map", TYPES.OccupancyGrid, latched=True),
            "map_metadata": self._sink("map_metadata", TYPES.MapMetaData, latched=True),
            "map_lines": self._sink("map_lines", TYPES.Marker, latched=True),
            "component": self._sink("component", TYPES.String, latched=True),
            "diagnostics": wire.advertise("/diagnostics", TYPES.DiagnosticArray, latched=False),
        }
        for topic, static in ((f"{tf}/tf", False), (f"{tf}/tf_static", True)):
            take = self._keep_static if static else self._keep
            wire.listen(topic, TYPES.TFMessage, take, latched=static, reliable=True)

    def connect(self, bridge: RobotBridge, settings: BridgeSettings) -> None:
        """Hand scans and odometry on to a bridge."""
        scan, odom = f"{self._namespace}/scan", f"{self._namespace}/odom"
        take = bridge.on_scan
        self._wire.listen(scan, TYPES.LaserScan, take, latched=False, reliable=False)
        if settings.odometry == "topic":
            keep = bridge.on_odometry
            self._wire.listen(odom, TYPES.Odometry, keep, latched=False, reliable=False)

    def now(self) -> int:
        """Return this machine's time [ns]."""
        return time.time_ns()

    def lookup(self, target: str, source: str, stamp: Any) -> Any:
        """Return a transform with `translation` and `rotation`. Raises NoTransformError."""
        when = None if stamp is None else nanoseconds(stamp)
        found = self._tree.lookup(target, source, when)
        x, y, z = found.translation
        i, j, k, w = found.rotation
        return SimpleNamespace(
            translation=SimpleNamespace(x=x, y=y, z=z),
            rotation=SimpleNamespace(x=i, y=j, z=k, w=w),
        )

    def publish(self, topic: str, message: Any) -> None:
        """Send one of the bridge's messages."""
        self._sinks[topic](message)

    def say(self, level: str, text: str) -> None:
        """Print to stderr."""
        print(f"{level}: {text}", file=sys.stderr, flush=True)

    def _sink(self, topic: str, kind: Any, *, latched: bool = False) -> Callable[[Any], None]:
        return self._wire.advertise(f"{self._namespace}/{topic}", kind, latched=latched)

    def _keep(self, message: Any) -> None:
        for transform in message.transforms:
            self._tree.put(transform, static=False)

    def _keep_static(self, message: Any) -> None:
        for transform in message.transforms:
            self._tree.put(transform, static=True)


def run(
    wire: Wire,
    settings: BridgeSettings,
    namespace: str,
    stopped: Callable[[], bool],
    *,
    shared_tf: bool = False,
) -> None:
    """Bridge one robot until `stopped` says so."""
    ports = WirePorts(wire, namespace, shared_tf=shared_tf)
    bridge = RobotBridge(settings, ports)
    ports.connect(bridge, settings)
    bridge.start()
    try:
        while not stopped():
            wire.spin_once(_TICK_S)
            bridge.tick()
    finally:
        bridge.close()
        wire.close()
