"""Where odometry had the base, from messages of a topic: asked for at a scan's own time."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque

from lineloom.bridge.planar import Planar

_KEPT = 2_000
_BACK_NS = 10**9
"""A message this much older than the one before: the clock was set back, or a bag begins anew."""


class OdometryTrack:
    """The latest poses by time."""

    def __init__(self) -> None:
        self._stamps: deque[int] = deque(maxlen=_KEPT)
        self._poses: deque[Planar] = deque(maxlen=_KEPT)

    def put(self, stamp: int, T_odom_base: Planar) -> None:
        """Take a pose of a time [ns]. One that is out of order is left out."""
        if self._stamps and stamp <= self._stamps[-1]:
            if self._stamps[-1] - stamp < _BACK_NS:
                return
            self._stamps.clear()
            self._poses.clear()
        self._stamps.append(stamp)
        self._poses.append(T_odom_base)

    def at(self, stamp: int) -> Planar | None:
        """Return the pose at a time [ns], interpolated; None before the first and after the last
        message: nothing is extrapolated."""
        if not self._stamps or not self._stamps[0] <= stamp <= self._stamps[-1]:
            return None
        after = bisect_left(self._stamps, stamp)
        if self._stamps[after] == stamp:
            return self._poses[after]
        begin, end = self._stamps[after - 1], self._stamps[after]
        share = (stamp - begin) / (end - begin)
        return between(self._poses[after - 1], self._poses[after], share)


def between(a: Planar, b: Planar, share: float) -> Planar:
    """Return the pose at a share of the way from a to b, turning the short way round."""
    turn = math.atan2(math.sin(b.theta - a.theta), math.cos(b.theta - a.theta))
    theta = a.theta + share * turn
    x, y = a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)
    return Planar(x, y, math.atan2(math.sin(theta), math.cos(theta)))
