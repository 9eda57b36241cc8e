"""Free space as evidence: what one sweep saw through cannot be a wall of the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.matching import _free_space_kernels as _kernels

TOLERANCE = 0.11
"""Range tolerance [m] at zero range."""
TOLERANCE_SLOPE = 0.01
"""Growth of the tolerance with range."""


@dataclass(frozen=True, slots=True)
class FreeSpaceCheck:
    """Metres of wall (at most 5 cm a point) by what the other side says of them.

    matched: measured there too. conflict: in front of what the other measured, where it saw free
    space. occluded: behind. outside: no beam went there, or it did not come back; never evidence.
    """

    matched: float
    conflict: float
    occluded: float
    outside: float

    @property
    def conflict_share(self) -> float:
        """Conflict over all that could be judged, 0..1; 0 where nothing could."""
        judged = self.matched + self.conflict
        return self.conflict / judged if judged > 0.0 else 0.0


def judge_sweeps(
    reference: ScanFeatures, current: ScanFeatures, T_reference_current: Pose
) -> FreeSpaceCheck:
    """Hold the points of each sweep against the other's ranges, both ways (polar form)."""
    counts = np.empty(4)
    _kernels.judge_pair(
        reference.points, reference.ranges, reference.angle_min, reference.angle_increment,
        current.points, current.ranges, current.angle_min, current.angle_increment,
        T_reference_current.to_array(), 1, TOLERANCE, TOLERANCE_SLOPE, counts,
    )  # fmt: skip
    return FreeSpaceCheck(*(float(v) for v in counts))


def seen_by(
    sweep: ScanFeatures, points: NDArray[np.float64], T_sweep_points: Pose
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which of the points (n, 2) a sweep measured, and which it saw through; n each.

    Neither where something stood before a point, or where no beam went or came back.
    """
    verdicts = np.empty(len(points), dtype=np.int64)
    _kernels.judge_each(
        points, T_sweep_points.to_array(), sweep.ranges, sweep.angle_min, sweep.angle_increment,
        TOLERANCE, TOLERANCE_SLOPE, verdicts,
    )  # fmt: skip
    return verdicts == _kernels.MATCHED, verdicts == _kernels.CONFLICT
