"""Laser scans on their way to the service, and where odometry had the base at each."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any, Protocol

from lineloom_bridge.planar import Planar

_REMEMBERED = 5_000
"""Scans: eight minutes at ten a second, longer than a service that keeps up is ever behind."""


class Outbox(Protocol):
    """What the feed needs of `lineloom.Outbox`."""

    session: str

    def put(self, scan: dict[str, Any]) -> int:
        """Take a scan and return its seq."""
        ...


class ScanFeed:
    """Takes sensor_msgs/LaserScan messages. max_rate: scans a second, at most; the rest is left
    out, evenly."""

    def __init__(self, outbox: Outbox, max_rate: float) -> None:
        self._outbox = outbox
        self._least_gap = 0.9 / max_rate if max_rate > 0.0 else 0.0
        self._last = float("-inf")
        self._odometry: OrderedDict[int, tuple[float, Planar | None]] = OrderedDict()

    @property
    def session(self) -> str:
        """The session that this start of the bridge sends under."""
        return self._outbox.session

    def wants(self, stamp: float) -> bool:
        """Tell whether a scan of this time would be sent."""
        return not 0.0 <= stamp - self._last < self._least_gap

    def put(self, message: Any, odometry: Planar | None) -> int | None:
        """Send a scan, with where odometry had the base; return its seq, None where left out.

        Raises what the outbox does on a scan that cannot be.
        """
        stamp = seconds(message.header.stamp)
        if not self.wants(stamp):
            return None
        seq = self._outbox.put(to_scan(message, stamp, odometry))
        self._last = stamp
        self._odometry[seq] = (stamp, odometry)
        while len(self._odometry) > _REMEMBERED:
            self._odometry.popitem(last=False)
        return seq

    def odometry_at(self, seq: int) -> Planar | None:
        """Return where odometry had the base at a scan of this session."""
        return self._odometry.get(seq, (0.0, None))[1]


def to_scan(message: Any, stamp: float, odometry: Planar | None) -> dict[str, Any]:
    """Return the contract's scan. NaN stays invalid, +inf no return (REP-117)."""
    scan: dict[str, Any] = {
        "stamp": stamp,
        "angle_min": float(message.angle_min),
        "angle_increment": float(message.angle_increment),
        "range_min": float(message.range_min),
        "range_max": float(message.range_max),
        "time_increment": max(0.0, float(message.time_increment)),
        "scan_time": max(0.0, float(message.scan_time)),
        "ranges": [float(value) for value in message.ranges],
    }
    if odometry is not None:
        scan["odometry"] = {"x": odometry.x, "y": odometry.y, "theta": odometry.theta}
    return scan


def seconds(stamp: Any) -> float:
    """Return a builtin_interfaces/Time in seconds."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)
