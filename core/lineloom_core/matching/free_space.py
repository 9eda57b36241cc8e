"""Free space as evidence: what one sweep saw through cannot be a wall of the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
