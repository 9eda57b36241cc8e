"""Times of messages as whole nanoseconds: a double of seconds since 1970 is off by hundreds."""

from __future__ import annotations

from typing import Any

SECOND = 10**9


def nanoseconds(stamp: Any) -> int:
    """Return a builtin_interfaces/Time in nanoseconds."""
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def seconds(stamp: Any) -> float:
    """Return a builtin_interfaces/Time in seconds."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def set_stamp(stamp: Any, ns: int) -> None:
    """Write nanoseconds into a builtin_interfaces/Time."""
    stamp.sec, stamp.nanosec = divmod(ns, SECOND)
