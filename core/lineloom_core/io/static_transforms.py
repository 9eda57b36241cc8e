"""How a lidar sits on its base, from transforms that never change."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.scan import Mount

_UPRIGHT = 0.98
"""Cosine of the tilt (11 degrees) up to which a lidar counts as level."""
_MOST_STEPS = 100


class TiltedLidarError(ValueError):
    """The lidar does not scan the level plane."""


class StaticTransforms:
    """A tree of frames. Messages are duck-typed: geometry_msgs/Transform."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, NDArray[np.float64]]] = {}

    def add(self, parent: str, child: str, transform: Any) -> None:
        """Take T_parent_child; the last one counts."""
        self._parents[child] = (parent, _matrix(transform))

    @property
    def frames(self) -> set[str]:
        """All frames that some transform names."""
        return set(self._parents) | {parent for parent, _ in self._parents.values()}

    def mount(self, base: str, laser: str) -> Mount | None:
        """Return the laser's place on the base; None where no chain of transforms leads there.

        `base` may stand behind a prefix ("r1/base_link"). Raises TiltedLidarError.
        """
        T, frame = np.eye(4), laser
        for _ in range(_MOST_STEPS):
            if frame == base or frame.endswith("/" + base):
                return _planar_mount(T, laser)
            if frame not in self._parents:
                return None
            frame, step = self._parents[frame]
            T = step @ T
        return None


def planar(transform: Any) -> Pose:
    """Return the pose in the plane of a geometry_msgs Pose or Transform."""
    T = _matrix(transform)
    return Pose(float(T[0, 3]), float(T[1, 3]), math.atan2(T[1, 0], T[0, 0]))


def _planar_mount(T: NDArray[np.float64], laser: str) -> Mount:
    if abs(T[2, 2]) < _UPRIGHT:
        tilt = math.degrees(math.acos(min(1.0, abs(float(T[2, 2])))))
        raise TiltedLidarError(f"the lidar {laser!r} is tilted by {tilt:.0f} degrees")
    pose = Pose(float(T[0, 3]), float(T[1, 3]), math.atan2(T[1, 0], T[0, 0]))
    return Mount(pose, inverted=bool(T[2, 2] < 0.0))


def _matrix(transform: Any) -> NDArray[np.float64]:
    """Return a Transform (translation) or Pose (position) as a 4x4 matrix."""
    at = transform.translation if hasattr(transform, "translation") else transform.position
    q = transform.rotation if hasattr(transform, "rotation") else transform.orientation
    x, y, z, w = (float(v) for v in (q.x, q.y, q.z, q.w))
    n = math.sqrt(x * x + y * y + z * z + w * w) or 1.0
    x, y, z, w = x / n, y / n, z / n, w / n
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), float(at.x)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), float(at.y)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), float(at.z)],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
