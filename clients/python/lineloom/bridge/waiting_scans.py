"""Scans that wait for odometry at their time: a transform mostly comes after its scan."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lineloom.bridge.planar import Planar

_MOST = 500
"""Beyond it the oldest is dropped: 50 seconds at ten a second, longer than any timeout in use."""


@dataclass(frozen=True)
class Released:
    """A scan whose wait is over. odometry: of the base at its time; None where it never came."""

    message: Any
    odometry: Planar | None


class WaitingScans:
    """Lets scans through in the order in which they came. timeout: how long one waits [s]."""

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._waiting: deque[tuple[float, Any]] = deque()

    def put(self, message: Any, now: float) -> None:
        """Take a scan, at a time of a clock that never goes back [s]."""
        self._waiting.append((now, message))

    def release(self, odometry_at: Callable[[Any], Planar | None], now: float) -> list[Released]:
        """Return the scans whose odometry is known, and those that waited for too long."""
        released: list[Released] = []
        while self._waiting:
            came, message = self._waiting[0]
            odometry = odometry_at(message)
            given_up = now - came >= self._timeout or len(self._waiting) > _MOST
            if odometry is None and not given_up:
                break
            self._waiting.popleft()
            released.append(Released(message, odometry))
        return released

    def clear(self) -> None:
        """Forget what waits."""
        self._waiting.clear()
