"""One scan as the checks look at it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan


@dataclass(frozen=True, eq=False)
class Sample:
    """A scan in counter-clockwise order, its features, and how the robot came there.

    step: T_previous_this of the lidar as tracking saw it, since the scan before; None where either
    was not placed. odometry_step: the base's as the wheels say, where they do. elapsed_s: between
    the two stamps. placed: whether tracking found it. began: it is the first of another track.
    """

    scan: Scan
    features: ScanFeatures
    step: Pose | None
    odometry_step: Pose | None
    elapsed_s: float
    placed: bool = True
    began: bool = False

    @property
    def is_blinded(self) -> bool:
        """Whether nothing was made of it though it holds something."""
        made = np.isfinite(self.features.ranges).any()
        return not made and bool(np.isfinite(self.scan.ranges).any())

    @property
    def moved_m(self) -> float:
        """How far the lidar moved since the scan before [m]."""
        return 0.0 if self.step is None else math.hypot(self.step.x, self.step.y)

    @property
    def driven_m(self) -> float:
        """How far it drove [m], by its wheels where tracking does not know."""
        step = self.step or self.odometry_step
        return 0.0 if step is None else math.hypot(step.x, step.y)

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
