"""The normal equations of one piece of a pose graph, factorised by sparse Cholesky.

Most keyframes hang between two tracked steps, so nearly all of the elimination is folding chains
up, and what is left is the graph of the loops' ends. On 3x3 blocks, in the order of least degree,
3,000 keyframes with a loop at every fourth take 1.5 ms to order, 1 ms to factorise and 0.2 ms per
right side. gtsam needs 16 ms for the same, scipy's scalar LU 30 ms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.graph import _elimination_kernels as elimination
from lineloom_core.graph import _residual_kernels as residuals
from lineloom_core.graph.piece import Piece

CAUCHY_K = 3.0
"""Whitened error at which a robust edge has lost half of its weight."""

_LEAST_PIVOT = 1e-12  # of the matrix's own entry: what is left is rounding


class NormalEquations:
    """The equations about a piece whose node in row `held` stays where it is.

    weights: (m,) factors on the edges' information, instead of the robust kernel.
    """

    def __init__(self, piece: Piece, held: int, weights: NDArray[np.float64] | None = None) -> None:
        count, m = len(piece.ids), len(piece.ends)
        free = np.delete(np.arange(count), held)
        place = np.full(count, -1, dtype=np.int64)
        place[free] = np.arange(count - 1)
        between = place[piece.ends]
        inner = between[(between >= 0).all(axis=1)]
        order, self._starts, self._rows = elimination.minimum_degree(count - 1, inner)
        self.column_of = np.full(count, -1, dtype=np.int64)
        self.column_of[free[order]] = np.arange(count - 1)
        self._columns = self.column_of[piece.ends]
        self._slots = elimination.slots_of(self._columns, self._starts, self._rows)
        self._piece, self._held = piece, held
        kernel = np.where(piece.robust, CAUCHY_K, np.inf)
        self._cauchy = kernel if weights is None else np.full(m, np.inf)
        self._weights = np.ones(m) if weights is None else weights
        self.gradient = np.empty((count - 1, 3))
        self._diagonal = np.empty((count - 1, 3, 3))
        self._below = np.empty((len(self._rows), 3, 3))

    def cost_at(self, poses: NDArray[np.float64], *, renew: bool) -> float:
        """Half the sum of the squared whitened errors at these poses (n, 3), under the kernel.

        `step` then has the gradient there; with `renew`, `factorise` the matrix too.
        """
        cost: float = residuals.linearise(
            poses, self._piece.ends, self._piece.measured, self._piece.information, self._weights,
            self._cauchy, self._columns, self._slots, self.gradient, self._diagonal, self._below,
            renew,
        )  # fmt: skip
        return cost

    def factorise(self) -> bool:
        """Factorise the matrix in place; false where it leaves a node free to move."""
        least = _LEAST_PIVOT * np.diagonal(self._diagonal, axis1=1, axis2=2)
        failed: int = elimination.factorise(
            self._diagonal, self._below, self._starts, self._rows, least
        )
        return failed < 0

    def step(self, poses: NDArray[np.float64]) -> float:
        """Move the poses in place by one step against the gradient; return its longest part."""
        x = -self.gradient
        elimination.substitute(self._diagonal, self._below, self._starts, self._rows, x, 0)
        longest: float = residuals.move(poses, self._held, self.column_of, x)
        return longest

    def inverse_columns(self, row: int) -> NDArray[np.float64]:
        """The inverse's blocks [by column of elimination, column of `row`], (n - 1, 3, 3)."""
        column = self.column_of[row]
        out = np.zeros((len(self._diagonal), 3, 3))
        for k in range(3):
            x = np.zeros((len(self._diagonal), 3))
            x[column, k] = 1.0
            elimination.substitute(self._diagonal, self._below, self._starts, self._rows, x, column)
            out[:, :, k] = x
        return out

    def inverse_diagonal(self) -> NDArray[np.float64]:
        """The inverse's diagonal blocks by column of elimination, (n - 1, 3, 3)."""
        blocks: NDArray[np.float64] = elimination.diagonal_of_inverse(
            self._diagonal, self._below, self._starts, self._rows
        )
        return blocks
