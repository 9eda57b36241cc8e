"""How sure the graph is of its poses: marginal and relative covariances.

gtsam's Marginals offer no choice of ordering and eliminate by COLAMD, which overflows the stack
on long chains (see `solver`). The normal equations are had anyway: factorised once, they give the
covariances of all poses at once, and those of all poses with one more by one right side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose, se2
from lineloom_core.graph.edge import Edge
from lineloom_core.graph.normal_equations import NormalEquations
from lineloom_core.graph.piece import Piece


class UndeterminedError(ValueError):
    """The edges leave a node free to move: it has no covariance."""


class Covariances:
    """The covariances of a connected piece's poses, relative to an anchor that counts as exact.

    Linearised at the poses given: ask after optimising. All answers are 3x3, order x, y, theta
    (m, rad), in the tangent space of the pose they are of, in its own axes (`in_map_axes` turns
    them). `weights` (m,) scales the edges' information. Robust kernels are left aside.

    Raises KeyError for an unknown anchor, UndeterminedError where edges leave a node free.
    """

    def __init__(
        self, piece: Piece, anchor: int, weights: NDArray[np.float64] | None = None
    ) -> None:
        self._piece = piece
        self._held = piece.row(anchor)
        factors = np.ones(len(piece.ends)) if weights is None else weights
        self._equations = NormalEquations(piece, self._held, factors)
        self._equations.cost_at(piece.poses, renew=True)
        if not self._equations.factorise():
            raise UndeterminedError("the edges leave at least one node free to move")
        self._diagonal: NDArray[np.float64] | None = None
        self._columns: dict[int, NDArray[np.float64]] = {}

    def of(self, node: int) -> NDArray[np.float64]:
        """Return the covariance of the node's pose relative to the anchor, shape (3, 3).

        Raises KeyError for a node outside of the piece.
        """
        return self._own(self._piece.row(node))

    def relative(self, node_a: int, node_b: int) -> NDArray[np.float64]:
        """Return the covariance of T_a_b in the tangent at b, shape (3, 3).

        With T_a_b = T_a^-1 T_b, the tangents relate by xi_ab = xi_b - Ad(T_b_a) xi_a. The choice of
        the anchor does not matter. The first question about a node_a takes a right side, more about
        the same take next to nothing.
        """
        a, b = self._piece.row(node_a), self._piece.row(node_b)
        if a == b:
            return np.zeros((3, 3))
        poses = self._piece.poses
        A = se2.adjoint(se2.between(poses[b], poses[a]))
        cross = A @ self._cross(b, a).T
        C = self._own(b) + A @ self._own(a) @ A.T - cross - cross.T
        symmetric: NDArray[np.float64] = 0.5 * (C + C.T)
        return symmetric

    def _own(self, row: int) -> NDArray[np.float64]:
        """Return a diagonal block of the inverse information, shape (3, 3)."""
        if row == self._held:
            return np.zeros((3, 3))
        if self._diagonal is None:
            self._diagonal = self._equations.inverse_diagonal()
        block: NDArray[np.float64] = self._diagonal[self._equations.column_of[row]]
        return block

    def _cross(self, row: int, column: int) -> NDArray[np.float64]:
        """Return the block (row, column) of the inverse information, shape (3, 3)."""
        if self._held in (row, column):
            return np.zeros((3, 3))
        if column not in self._columns:
            self._columns[column] = self._equations.inverse_columns(column)
        block: NDArray[np.float64] = self._columns[column][self._equations.column_of[row]]
        return block


def marginal_covariance(
    nodes: Mapping[int, Pose],
    edges: Sequence[Edge],
    anchor: int,
    node: int,
    node2: int | None = None,
) -> NDArray[np.float64]:
    """Return the covariance of one pose, or of T_node_node2, shape (3, 3).

    In the tangent at `node` (or at `node2`), in its axes. For several questions build one
    `Covariances`. Raises as that does.
    """
    covariances = Covariances(Piece.of(nodes, edges), anchor)
    return covariances.of(node) if node2 is None else covariances.relative(node, node2)


def in_map_axes(covariance: NDArray[np.float64], pose: Pose) -> NDArray[np.float64]:
    """Return a covariance in the tangent at `pose` as one of (x, y, theta) in the map's axes."""
    return se2.transport(covariance, np.array([0.0, 0.0, pose.theta]))
