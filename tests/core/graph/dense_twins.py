"""Slow and obvious: every entry of the normal equations, derivatives by differences.

Nodes of a component are numbered from 0 on, so that ids are rows.
"""

from __future__ import annotations

import numpy as np
from lineloom_core.geometry import se2
from lineloom_core.graph.factors import CAUCHY_K
from lineloom_core.graph.growth import Growth
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEPS = 60


def edge_errors(component: Growth, poses: Array) -> Array:
    """Log(measured^-1 T_a_b) of every edge, (m, 3)."""
    a, b = poses[component.ends[:, 0]], poses[component.ends[:, 1]]
    return se2.log(se2.between(component.measured, se2.between(a, b)))


def chi2(component: Growth, poses: Array) -> Array:
    """Squared whitened error of every edge, (m,)."""
    errors = edge_errors(component, poses)
    return np.array([e @ W @ e for e, W in zip(errors, component.information, strict=True)])


def cost(component: Growth, poses: Array) -> float:
    """Half the sum of squares, under Cauchy kernels on the robust edges."""
    k2 = CAUCHY_K**2
    plain = chi2(component, poses)
    return float(0.5 * np.where(component.robust, k2 * np.log1p(plain / k2), plain).sum())


def moved(poses: Array, row: int, axis: int, by: float) -> Array:
    """The poses, one of them moved along one of its own axes."""
    step = np.zeros(3)
    step[axis] = by
    out = poses.copy()
    out[row] = se2.compose(out[row], step)
    return out


def jacobian(component: Growth, poses: Array, step: float = 1e-6) -> Array:
    """Derivatives of all edges' errors, (3 m, 3 n)."""
    columns = [
        (
            edge_errors(component, moved(poses, i, k, step))
            - edge_errors(component, moved(poses, i, k, -step))
        ).ravel()
        / (2.0 * step)
        for i in range(len(poses))
        for k in range(3)
    ]
    return np.array(columns).T


def matrix(component: Growth, poses: Array, information: Array) -> Array:
    """The sum of J^T W J, (3 n, 3 n); information (m, 3, 3)."""
    J, W = jacobian(component, poses), block_diagonal(information)
    return np.asarray(J.T @ W @ J)


def optimum(component: Growth, held: int) -> Array:
    """Poses (n, 3) that fit best, one held: Gauss-Newton with halved steps where they overshoot."""
    poses, free = component.poses.copy(), free_columns(len(component.ids), held)
    for _ in range(_STEPS):
        c2 = chi2(component, poses)
        weights = np.where(component.robust, CAUCHY_K**2 / (CAUCHY_K**2 + c2), 1.0)
        weighted = weights[:, None, None] * component.information
        J = jacobian(component, poses)[:, free]
        W = block_diagonal(weighted)
        gradient = J.T @ W @ edge_errors(component, poses).ravel()
        step = np.zeros(3 * len(poses))
        step[free] = -np.linalg.solve(J.T @ W @ J, gradient)
        share = 1.0
        while share > 1e-3:
            there = se2.compose(poses, share * step.reshape(-1, 3))
            if cost(component, there) <= cost(component, poses):
                break
            share *= 0.5
        poses = there
        if np.abs(step).max() < 1e-8:
            break
    return poses


def relative_covariance(component: Growth, poses: Array, a: int, b: int) -> Array:
    """Covariance (3, 3) of T_a_b in the tangent at b, by drift: that of b with a held."""
    free = free_columns(len(poses), a)
    whole = matrix(component, poses, component.drift_information)
    inverse = np.linalg.inv(whole[np.ix_(free, free)])
    at = [int(np.flatnonzero(free == 3 * b + k)[0]) for k in range(3)]
    return np.asarray(inverse[np.ix_(at, at)])


def free_columns(count: int, held: int) -> NDArray[np.int64]:
    """Columns of all nodes but one."""
    nodes = np.delete(np.arange(count), held)
    return np.asarray((3 * nodes[:, None] + np.arange(3)).ravel())


def block_diagonal(information: Array) -> Array:
    """(m, 3, 3) as (3 m, 3 m)."""
    W = np.zeros((3 * len(information), 3 * len(information)))
    for m, block in enumerate(information):
        W[3 * m : 3 * m + 3, 3 * m : 3 * m + 3] = block
    return W
