"""Several lidars on one robot: what is known of a log whose trajectory nobody knows.

Wherever two of them are in one component, they must lie to each other as they are mounted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose, se2
from lineloom_core.geometry.angles import wrap_array
from numpy.typing import NDArray

from lineloom_lab.evaluation.log_bench_judge import AGREE_M, AGREE_RAD, PlacedRobot
from lineloom_lab.evaluation.log_bench_log import Recording, RigidPair

_LONGEST_GAP_S = 0.3

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RigidFigures:
    """compared: scans of one lidar in a component that the other was in at that time. agreeing: of
    these, within `AGREE_M` and `AGREE_RAD` of how the two are mounted."""

    compared: int
    agreeing: int

    @property
    def share_agreeing(self) -> float | None:
        """Of those compared; None where the two were never in one component."""
        return self.agreeing / self.compared if self.compared else None


def rigid_figures(
    robots: Sequence[Recording], placed: Sequence[PlacedRobot], pair: RigidPair
) -> RigidFigures:
    """Compare two lidars, whose clocks are one, at each scan of the second.

    A recording that is cut has several robots: their names begin with its own.
    """
    first, second = (
        [(r, p) for r, p in zip(robots, placed, strict=True) if r.robot.startswith(name)]
        for name in (pair.first, pair.second)
    )
    compared = agreeing = 0
    for recording, other in first:
        for theirs, mine in second:
            off = _offsets(recording, other, theirs, mine, pair.T_first_second)
            compared += len(off)
            near = np.hypot(off[:, 0], off[:, 1]) <= AGREE_M
            agreeing += int(np.count_nonzero(near & (np.abs(off[:, 2]) <= AGREE_RAD)))
    return RigidFigures(compared, agreeing)


def _offsets(
    recording_a: Recording, a: PlacedRobot, recording_b: Recording, b: PlacedRobot, T_a_b: Pose
) -> Array:
    """Return T_mounted_found for each scan of b that can be compared, shape (n, 3)."""
    stamps_a, stamps_b = (
        np.array([scan.stamp for scan in r.scans]) for r in (recording_a, recording_b)
    )
    after = np.searchsorted(stamps_a, stamps_b)
    between = (after > 0) & (after < len(stamps_a))
    i = np.clip(after, 1, max(len(stamps_a) - 1, 1))
    if len(stamps_a) < 2:
        return np.empty((0, 3))
    gap = stamps_a[i] - stamps_a[i - 1]
    same = (a.component[i - 1] == b.component) & (a.component[i] == b.component)
    use = between & same & b.placed & (gap > 0.0) & (gap <= _LONGEST_GAP_S)
    i, gap = i[use], gap[use]
    share = (stamps_b[use] - stamps_a[i - 1]) / gap
    begin, end = a.poses[i - 1], a.poses[i]
    there = begin + share[:, None] * np.column_stack(
        [end[:, :2] - begin[:, :2], wrap_array(end[:, 2] - begin[:, 2])]
    )
    return se2.between(se2.compose(there, T_a_b.to_array()), b.poses[use])
