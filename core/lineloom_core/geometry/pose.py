"""Rigid motions of the plane, SE(2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry.angles import wrap


@storable("pose")
@dataclass(frozen=True, slots=True)
class Pose:
    """A rigid motion T_target_source: p_target = R(theta) p_source + (x, y).

    x, y in metres, theta in radians, counter-clockwise. `T_a_b @ T_b_c == T_a_c`.
    """

    x: float
    y: float
    theta: float

    @staticmethod
    def identity() -> Pose:
        """Return the motion that moves nothing."""
        return Pose(0.0, 0.0, 0.0)

    @staticmethod
    def from_array(xyt: ArrayLike) -> Pose:
        """Build a pose from three numbers (x, y, theta)."""
        x, y, theta = np.asarray(xyt, dtype=np.float64).tolist()
        return Pose(x, y, theta)

    def to_array(self) -> NDArray[np.float64]:
        """Return (x, y, theta) as a float64 array of shape (3,)."""
        return np.array([self.x, self.y, self.theta])

    def __matmul__(self, other: Pose) -> Pose:
        """Compose: T_a_b @ T_b_c = T_a_c."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            wrap(self.theta + other.theta),
        )

    def inverse(self) -> Pose:
        """Return T_source_target."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose(-c * self.x - s * self.y, s * self.x - c * self.y, wrap(-self.theta))

    def between(self, other: Pose) -> Pose:
        """Return T_self_other = self^-1 @ other, both given in one common frame."""
        return self.inverse() @ other

    def transform(self, points: ArrayLike) -> NDArray[np.float64]:
        """Map points of shape (n, 2) [m] from the source into the target frame."""
        p = np.asarray(points, dtype=np.float64)
        c, s = math.cos(self.theta), math.sin(self.theta)
        moved: NDArray[np.float64] = p @ np.array([[c, s], [-s, c]]) + np.array([self.x, self.y])
        return moved

    def adjoint(self) -> NDArray[np.float64]:
        """Return the 3x3 adjoint: a twist in the source frame seen from the target frame."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return np.array([[c, -s, self.y], [s, c, -self.x], [0.0, 0.0, 1.0]])

    def distance(self, other: Pose) -> float:
        """Return the translational distance to `other` [m]."""
        return math.hypot(self.x - other.x, self.y - other.y)
