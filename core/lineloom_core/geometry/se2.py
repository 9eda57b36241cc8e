"""SE(2) on whole arrays of poses: for inner loops, and without a solver.

A pose is a row (x, y, theta) in m, m, rad. Tangent vectors are (dx, dy, dtheta) in the axes of
the pose's source frame (right perturbation: T = T_hat Exp(xi)), as in gtsam. Every function
broadcasts over leading dimensions.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array

Array = NDArray[np.float64]

_SMALL_ANGLE_RAD = 1e-4  # below it the series is exact to double precision


def stack(poses: Iterable[Pose]) -> Array:
    """Return the poses as rows (x, y, theta), shape (n, 3)."""
    rows = [(p.x, p.y, p.theta) for p in poses]
    return np.array(rows, dtype=np.float64).reshape(len(rows), 3)


def compose(T_a_b: Array, T_b_c: Array) -> Array:
    """Return T_a_c = T_a_b T_b_c, shape (..., 3)."""
    c, s = np.cos(T_a_b[..., 2]), np.sin(T_a_b[..., 2])
    x = T_a_b[..., 0] + c * T_b_c[..., 0] - s * T_b_c[..., 1]
    y = T_a_b[..., 1] + s * T_b_c[..., 0] + c * T_b_c[..., 1]
    return np.stack([x, y, wrap_array(T_a_b[..., 2] + T_b_c[..., 2])], axis=-1)


def inverse(T_a_b: Array) -> Array:
    """Return T_b_a, shape (..., 3)."""
    c, s = np.cos(T_a_b[..., 2]), np.sin(T_a_b[..., 2])
    x = -c * T_a_b[..., 0] - s * T_a_b[..., 1]
    y = s * T_a_b[..., 0] - c * T_a_b[..., 1]
    return np.stack([x, y, wrap_array(-T_a_b[..., 2])], axis=-1)


def between(T_m_a: Array, T_m_b: Array) -> Array:
    """Return T_a_b of two sets of poses in one map frame, shape (..., 3)."""
    return compose(inverse(T_m_a), T_m_b)


def log(T: Array) -> Array:
    """Return the tangent vectors whose exponential is T, shape (..., 3).

    The logarithm of SE(2) (Solà, Deray and Atchuthan 2018, eq. 158), as gtsam's Pose2.Logmap.
    """
    half = 0.5 * T[..., 2]
    small = np.abs(half) < _SMALL_ANGLE_RAD
    safe = np.where(small, 1.0, half)
    a = np.where(small, 1.0 - half * half / 3.0, safe / np.tan(safe))
    x = a * T[..., 0] + half * T[..., 1]
    y = -half * T[..., 0] + a * T[..., 1]
    return np.stack([x, y, T[..., 2]], axis=-1)


def adjoint(T_a_b: Array) -> Array:
    """Return the adjoints, shape (..., 3, 3): a twist in b seen from a (see `Pose.adjoint`)."""
    c, s = np.cos(T_a_b[..., 2]), np.sin(T_a_b[..., 2])
    A = np.zeros((*T_a_b.shape[:-1], 3, 3))
    A[..., 0, 0], A[..., 0, 1], A[..., 0, 2] = c, -s, T_a_b[..., 1]
    A[..., 1, 0], A[..., 1, 1], A[..., 1, 2] = s, c, -T_a_b[..., 0]
    A[..., 2, 2] = 1.0
    return A


def transport(covariance: Array, T_a_b: Array) -> Array:
    """Return a covariance in the tangent at b as seen from a: Ad C Ad^T, shape (..., 3, 3)."""
    A = adjoint(T_a_b)
    moved: Array = A @ covariance @ np.swapaxes(A, -1, -2)
    return moved
