"""Laser scans on their way to the service, and where odometry had the base at each."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any, Protocol

from lineloom.bridge.planar import Planar
from lineloom.bridge.stamps import nanoseconds, seconds

_REMEMBERED = 5_000
"""Scans: eight minutes at ten a second, longer than a service that keeps up is ever behind."""


class Outbox(Protocol):
    """What the feed needs of `lineloom.Outbox`."""

    session: str

    def put(self, scan: dict[str, Any]) -> int:
        """Take a scan and return its seq."""
        ...


@dataclass(frozen=True)
class SentScan:
    """When a scan was taken [ns of its own clock], and where odometry had the base, if asked."""

    stamp: int
    T_odom_base: Planar | None


class ScanFeed:
    """Takes sensor_msgs/LaserScan messages. max_rate: scans a second, at most; the rest is left
    out, evenly; 0 for no limit."""

    def __init__(self, outbox: Outbox, max_rate: float) -> None:
        self._outbox = outbox
        self._least_gap = 0.9 / max_rate if max_rate > 0.0 else 0.0
        self._last = float("-inf")
        self._sent: OrderedDict[int, SentScan] = OrderedDict()

    @property
    def session(self) -> str:
        """The session that this start of the bridge sends under."""
        return self._outbox.session

    def admits(self, message: Any) -> bool:
        """Tell whether a scan is to be sent, and count it where it is."""
        stamp = seconds(message.header.stamp)
        if 0.0 <= stamp - self._last < self._least_gap:
            return False
        self._last = stamp
        return True

    def put(self, message: Any, odometry: Planar | None) -> int:
        """Send a scan, with where odometry had the base; return its seq.

        Raises what the outbox does on a scan that cannot be.
        """
        seq = self._outbox.put(to_scan(message, odometry))
        self._sent[seq] = SentScan(nanoseconds(message.header.stamp), odometry)
        while len(self._sent) > _REMEMBERED:
            self._sent.popitem(last=False)
        return seq

    def sent(self, seq: int) -> SentScan | None:
        """Return what is remembered of a scan of this session."""
        return self._sent.get(seq)


def to_scan(message: Any, odometry: Planar | None) -> dict[str, Any]:
    """Return the contract's scan. NaN stays invalid, +inf no return (REP-117)."""
    scan: dict[str, Any] = {
        "stamp": seconds(message.header.stamp),
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
