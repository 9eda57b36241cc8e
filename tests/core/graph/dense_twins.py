"""Slow and obvious: normal equations with every entry, derivatives by differences."""

from __future__ import annotations

import numpy as np
from lineloom_core.geometry import se2
from lineloom_core.graph import Piece
from lineloom_core.graph.normal_equations import CAUCHY_K
from numpy.typing import NDArray

Array = NDArray[np.float64]


def edge_errors(piece: Piece, poses: Array) -> Array:
    """Log(measured^-1 T_a_b) of every edge, (m, 3)."""
    a, b = poses[piece.ends[:, 0]], poses[piece.ends[:, 1]]
    return se2.log(se2.between(piece.measured, se2.between(a, b)))


def chi2(piece: Piece, poses: Array) -> Array:
    """Squared whitened error of every edge, (m,)."""
    errors = edge_errors(piece, poses)
    return np.array([e @ W @ e for e, W in zip(errors, piece.information, strict=True)])


def cost(piece: Piece, poses: Array) -> float:
    """Half the sum of squares, under Cauchy kernels on the robust edges."""
    k2 = CAUCHY_K**2
    plain = chi2(piece, poses)
    return float(0.5 * np.where(piece.robust, k2 * np.log1p(plain / k2), plain).sum())


def moved(poses: Array, row: int, axis: int, by: float) -> Array:
    """The poses, one of them moved along one of its own axes."""
    step = np.zeros(3)
    step[axis] = by
    out = poses.copy()
    out[row] = se2.compose(out[row], step)
    return out


def gradient(piece: Piece, poses: Array, step: float = 1e-6) -> Array:
    """The cost's derivatives by every pose's own axes, (n, 3)."""
    return np.array(
        [
            [
                (cost(piece, moved(poses, i, k, step)) - cost(piece, moved(poses, i, k, -step)))
                / (2.0 * step)
                for k in range(3)
            ]
            for i in range(len(poses))
        ]
    )


def jacobian(piece: Piece, poses: Array, step: float = 1e-6) -> Array:
    """Derivatives of all edges' errors, (3 m, 3 n)."""
    columns = [
        (
            edge_errors(piece, moved(poses, i, k, step))
            - edge_errors(piece, moved(poses, i, k, -step))
        ).ravel()
        / (2.0 * step)
        for i in range(len(poses))
        for k in range(3)
    ]
    return np.array(columns).T


def matrix(piece: Piece, poses: Array, weights: Array) -> Array:
    """The sum of J^T W J, (3 n, 3 n)."""
    J = jacobian(piece, poses)
    W = np.zeros((J.shape[0], J.shape[0]))
    for m, information in enumerate(piece.information):
        W[3 * m : 3 * m + 3, 3 * m : 3 * m + 3] = weights[m] * information
    return np.asarray(J.T @ W @ J)
