"""Rotational and translational errors, between consecutive scans and global (§6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class PathErrors:
    """The four errors of Fig. 6.3 and 6.5 for n scans.

    rotation [rad], translation [m]: of the pairs (S_i, S_i+1), (n - 1,), the translation in the
    frame of S_r. translation_as_printed [m]: the same in world coordinates. global_rotation [rad],
    global_translation [m]: of S_i, 0 < i, (n - 1,).
    """

    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]
    translation_as_printed: NDArray[np.float64]
    global_rotation: NDArray[np.float64]
    global_translation: NDArray[np.float64]

    def right(self, translation_limit: float = 0.3, rotation_limit: float = np.radians(5.0)) -> int:
        """Count pairs whose error is below both limits [m, rad]."""
        good = (self.translation < translation_limit) & (self.rotation < rotation_limit)
        return int(good.sum())


def path_errors(estimated: Sequence[Pose], true: Sequence[Pose]) -> PathErrors:
    """Compute the formulas of §6.2 for estimated and true T_world_laser of the same scans.

    The rotational error is |(theta'_c - theta'_r) - (theta_c - theta_r)|, taken the short way
    round. The translational error between two scans is given twice: as printed, on differences of
    world coordinates, it charges each pair with all the rotation that earlier pairs got wrong; in
    the frame of S_r it speaks of this pair alone. Raises ValueError where the counts differ.
    """
    if len(estimated) != len(true):
        raise ValueError(f"{len(estimated)} estimated poses for {len(true)} true ones")
    e = np.array([p.to_array() for p in estimated]).reshape(-1, 3)
    t = np.array([p.to_array() for p in true]).reshape(-1, 3)
    steps = _steps(e) - _steps(t)
    off = e - t
    world = np.diff(off, axis=0)
    return PathErrors(
        rotation=np.abs(wrap_array(steps[:, 2])),
        translation=np.hypot(steps[:, 0], steps[:, 1]),
        translation_as_printed=np.hypot(world[:, 0], world[:, 1]),
        global_rotation=np.abs(wrap_array(off[1:, 2])),
        global_translation=np.hypot(off[1:, 0], off[1:, 1]),
    )


def _steps(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses of S_i+1 in S_i, (n - 1, 3), angles not wrapped."""
    d = np.diff(poses, axis=0)
    c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    return np.column_stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]])
