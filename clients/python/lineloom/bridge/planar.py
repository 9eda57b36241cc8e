"""Poses in the plane, and the messages' quaternions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

_UPRIGHT = 0.98
"""Cosine of the tilt (11 degrees) up to which a lidar counts as level."""


class TiltedLidarError(ValueError):
    """The lidar does not scan the level plane."""


@dataclass(frozen=True)
class Planar:
    """T_target_source in the plane [m, rad]. `T_a_b @ T_b_c == T_a_c`."""

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0

    def __matmul__(self, other: Planar) -> Planar:
        """Compose."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        turn = self.theta + other.theta
        return Planar(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            math.atan2(math.sin(turn), math.cos(turn)),
        )

    def inverse(self) -> Planar:
        """Return T_source_target."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Planar(-c * self.x - s * self.y, s * self.x - c * self.y, -self.theta)

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Return x, y, z, w."""
        return 0.0, 0.0, math.sin(0.5 * self.theta), math.cos(0.5 * self.theta)


@dataclass(frozen=True)
class MountPose:
    """How a lidar sits on its base: T_base_laser, and whether upside down."""

    T_base_laser: Planar
    inverted: bool


def planar(position: Any, rotation: Any) -> Planar:
    """Return the pose of a geometry_msgs position (or translation) and quaternion."""
    return Planar(float(position.x), float(position.y), _yaw(rotation))


def mount(translation: Any, rotation: Any) -> MountPose:
    """Return a lidar's mount from its transform in the base. Raises TiltedLidarError."""
    x, y = float(rotation.x), float(rotation.y)
    up = 1.0 - 2.0 * (x * x + y * y)  # z component of the laser's z axis in the base
    if abs(up) < _UPRIGHT:
        tilt = math.degrees(math.acos(min(1.0, abs(up))))
        raise TiltedLidarError(f"the lidar is tilted by {tilt:.0f} degrees")
    return MountPose(planar(translation, rotation), inverted=up < 0.0)


def _yaw(q: Any) -> float:
    """Return the direction of the x axis; right also for what is upside down."""
    x, y, z, w = float(q.x), float(q.y), float(q.z), float(q.w)
    return math.atan2(2.0 * (x * y + z * w), 1.0 - 2.0 * (y * y + z * z))
