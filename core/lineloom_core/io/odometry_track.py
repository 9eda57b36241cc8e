"""Where a base was in its odom frame, at any time between two messages."""

from __future__ import annotations

from bisect import bisect_left

from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap

_LONGEST_GAP_S = 0.5


class OdometryTrack:
    """Poses by stamp [s]; they come in order but for the odd one, which is dropped."""

    def __init__(self) -> None:
        self._stamps: list[float] = []
        self._poses: list[Pose] = []

    def add(self, stamp: float, pose: Pose) -> None:
        """Take the next pose."""
        if not self._stamps or stamp > self._stamps[-1]:
            self._stamps.append(stamp)
            self._poses.append(pose)

    def at(self, stamp: float) -> Pose | None:
        """Return the pose at a stamp, between its neighbours; None more than half a second off."""
        after = bisect_left(self._stamps, stamp)
        near = [i for i in (after - 1, after) if 0 <= i < len(self._stamps)]
        near = [i for i in near if abs(self._stamps[i] - stamp) <= _LONGEST_GAP_S]
        if not near:
            return None
        if len(near) == 1:
            return self._poses[near[0]]
        first, second = self._poses[near[0]], self._poses[near[1]]
        begin, end = self._stamps[near[0]], self._stamps[near[1]]
        t = (stamp - begin) / (end - begin)
        return Pose(
            first.x + t * (second.x - first.x),
            first.y + t * (second.y - first.y),
            wrap(first.theta + t * wrap(second.theta - first.theta)),
        )
