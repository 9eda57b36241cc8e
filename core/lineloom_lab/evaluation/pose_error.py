"""How far one pose is from another."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lineloom_core.geometry import Pose, angle_difference


@dataclass(frozen=True, slots=True)
class PoseError:
    """The difference between an estimated and a true pose, both T_target_source.

    translation: distance of the origins [m]. rotation: absolute angle between the axes [rad],
    at most pi. dx, dy: estimate minus truth [m], in the target frame.
    """

    translation: float
    rotation: float
    dx: float
    dy: float

    def across(self, direction: float) -> float:
        """Return the part of the translation at right angles to `direction` [rad, target frame]."""
        return abs(-math.sin(direction) * self.dx + math.cos(direction) * self.dy)

    def along(self, direction: float) -> float:
        """Return the part of the translation along `direction` [rad, target frame]."""
        return abs(math.cos(direction) * self.dx + math.sin(direction) * self.dy)


def pose_error(estimate: Pose, truth: Pose) -> PoseError:
    """Return how far `estimate` is from `truth`."""
    dx, dy = estimate.x - truth.x, estimate.y - truth.y
    rotation = abs(angle_difference(estimate.theta, truth.theta))
    return PoseError(math.hypot(dx, dy), rotation, dx, dy)
