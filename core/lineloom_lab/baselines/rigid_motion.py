"""Least-squares rigid motions in closed form."""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.geometry import Pose
from numpy.typing import NDArray


def motion_of_points(
    source: NDArray[np.float64],
    target: NDArray[np.float64],
    weights: NDArray[np.float64] | None = None,
) -> Pose:
    """Return T_target_source minimising sum w |R s + t - p|^2.

    source, target: (n, 2) [m], row by row the same point; weights: (n,), ones if left out. F. Lu
    and E. Milios (thesis [18]), appendix: the rotation from the sums of products, the translation
    from the centroids.
    """
    w = np.ones(len(source)) if weights is None else weights
    total = float(w.sum())
    centre_s, centre_t = w @ source / total, w @ target / total
    s, p = source - centre_s, target - centre_t
    cross = float(w @ (s[:, 0] * p[:, 1] - s[:, 1] * p[:, 0]))
    dot = float(w @ (s[:, 0] * p[:, 0] + s[:, 1] * p[:, 1]))
    theta = math.atan2(cross, dot)
    shift = centre_t - Pose(0.0, 0.0, theta).transform(centre_s)
    return Pose(float(shift[0]), float(shift[1]), theta)


def shift_of_constraints(
    normals: NDArray[np.float64], offsets: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float] | None:
    """Return the translation (2,) [m] minimising sum w (n . t - offset)^2, and how fixed it is.

    normals: (n, 2) unit vectors; offsets: (n,) [m]; weights: (n,). The second figure is the
    smaller over the greater eigenvalue of the normal matrix, 0..1. None where all normals are
    parallel: nothing fixes the translation along the lines then (design §4, departure 8).
    """
    matrix = (normals * weights[:, None]).T @ normals
    low, high = (float(v) for v in np.linalg.eigvalsh(matrix))
    if high <= 0.0 or low < 1e-3 * high:
        return None
    shift = np.linalg.solve(matrix, normals.T @ (weights * offsets))
    return np.asarray(shift, dtype=np.float64), low / high
