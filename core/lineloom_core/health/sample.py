"""One scan as the checks look at it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan


@dataclass(frozen=True, eq=False)
class Sample:
    """A scan in counter-clockwise order, its features, and how the robot came there.

    step: T_previous_this of the lidar as tracking saw it, since the scan before; None where either
    was not placed. odometry_step: the same as the wheels say. elapsed_s: between the two stamps.
    """

    scan: Scan
    features: ScanFeatures
    step: Pose | None
    odometry_step: Pose | None
    elapsed_s: float

    @property
    def moved_m(self) -> float:
        """How far the lidar moved since the scan before [m]."""
        return 0.0 if self.step is None else math.hypot(self.step.x, self.step.y)

    @property
    def turned_rad(self) -> float:
        """How far it turned since the scan before [rad], counter-clockwise."""
        return 0.0 if self.step is None else self.step.theta

    @property
    def turn_rate(self) -> float | None:
        """Turn rate since the scan before [rad/s]; None where it is not known."""
        if self.step is None or not 0.01 < self.elapsed_s < 1.0:
            return None
        return self.step.theta / self.elapsed_s
