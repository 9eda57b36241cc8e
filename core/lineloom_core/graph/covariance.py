"""How sure the graph is of its poses: marginal and relative covariances.

gtsam's Marginals offer no choice of ordering and eliminate by COLAMD, which overflows the stack
on long chains (see `solver`). The normal equations are small enough to do without: one sparse LU
(30 ms at 3,000 nodes), then 2 ms per question.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from lineloom_core.geometry import Pose
from lineloom_core.graph import se2
from lineloom_core.graph.components import Components
from lineloom_core.graph.edge import Edge


class UndeterminedError(ValueError):
    """The edges leave a node free to move: it has no covariance."""


class Covariances:
    """The covariances of one component's poses, relative to an anchor that counts as exact.

    Linearised at the poses given: ask after optimising. Nodes of other components are ignored.
    All answers are 3x3, order x, y, theta (m, rad), in the tangent space of the pose they are of,
    in its own axes (`in_map_axes` turns them). `weights`, by edge id, scales information, as
    `Solution.weights` gives it.

    Raises KeyError for an unknown anchor, UndeterminedError where edges leave a node free.
    """

    def __init__(
        self,
        nodes: Mapping[int, Pose],
        edges: Sequence[Edge],
        anchor: int,
        weights: Mapping[str, float] | None = None,
    ) -> None:
        components = Components(nodes, ((e.node_a, e.node_b) for e in edges))
        root = components.root(anchor)
        members = [node for node in sorted(nodes) if components.root(node) == root]
        inside = sorted(
            (e for e in edges if components.root(e.node_a) == root),
            key=lambda e: (e.node_a, e.node_b, e.id),
        )
        self._anchor = anchor
        self._nodes = {node: nodes[node] for node in members}
        free = [node for node in members if node != anchor]
        self._column = {node: 3 * i for i, node in enumerate(free)}
        self._lu = self._factorise(inside, weights) if free else None
        self._solved: dict[int, NDArray[np.float64]] = {}

    def of(self, node: int) -> NDArray[np.float64]:
        """Return the covariance of the node's pose relative to the anchor, shape (3, 3).

        Raises KeyError for a node outside of the anchor's component.
        """
        return self._block(node, node)

    def relative(self, node_a: int, node_b: int) -> NDArray[np.float64]:
        """Return the covariance of T_a_b in the tangent at b, shape (3, 3).

        With T_a_b = T_a^-1 T_b, the tangents relate by xi_ab = xi_b - Ad(T_b_a) xi_a. The choice of
        the anchor does not matter.
        """
        if node_a == node_b:
            return np.zeros((3, 3))
        T_b_a = self._nodes[node_b].between(self._nodes[node_a])
        A = T_b_a.adjoint()
        cross = A @ self._block(node_a, node_b)
        C = self._block(node_b, node_b) + A @ self._block(node_a, node_a) @ A.T - cross - cross.T
        return _symmetric(C)

    def _block(self, row: int, column: int) -> NDArray[np.float64]:
        """Return the block (row, column) of the inverse information, shape (3, 3)."""
        for node in (row, column):
            if node not in self._nodes:
                raise KeyError(f"node {node} is not connected with the anchor {self._anchor}")
        if self._anchor in (row, column):
            return np.zeros((3, 3))
        r = self._column[row]
        block: NDArray[np.float64] = self._columns(column)[r : r + 3]
        return _symmetric(block) if row == column else block

    def _columns(self, node: int) -> NDArray[np.float64]:
        if node not in self._solved:
            assert self._lu is not None
            unit = np.zeros((3 * len(self._column), 3))
            c = self._column[node]
            unit[c : c + 3] = np.eye(3)
            solved = self._lu.solve(unit)
            if not np.all(np.isfinite(solved)) or np.any(np.diag(solved[c : c + 3]) <= 0.0):
                raise UndeterminedError(f"the edges leave node {node} free to move")
            self._solved[node] = solved
        return self._solved[node]

    def _factorise(
        self, edges: Sequence[Edge], weights: Mapping[str, float] | None
    ) -> scipy.sparse.linalg.SuperLU:
        rows, columns, entries = [], [], []
        for row, column, blocks in self._normal_blocks(edges, weights):
            keep = (row >= 0) & (column >= 0)  # the anchor does not move: no row, no column
            offset = np.arange(3)
            full_row = row[keep, None, None] + offset[None, :, None]
            full_column = column[keep, None, None] + offset[None, None, :]
            rows.append(np.broadcast_to(full_row, (int(keep.sum()), 3, 3)).ravel())
            columns.append(np.broadcast_to(full_column, (int(keep.sum()), 3, 3)).ravel())
            entries.append(blocks[keep].ravel())
        size = 3 * len(self._column)
        H = scipy.sparse.csc_matrix(
            (np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))),
            shape=(size, size),
        )
        try:
            return splu(
                H,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise UndeterminedError("the edges leave at least one node free to move") from error

    def _normal_blocks(
        self, edges: Sequence[Edge], weights: Mapping[str, float] | None
    ) -> list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]]:
        """Return the (row, column, 3x3) blocks of J^T I J; row -1 stands for the anchor.

        J_a = -Ad(T_b_a), J_b = 1: the inverse right Jacobian of the error is left out, it is the
        identity where the edges fit.
        """
        T_a = se2.stack(self._nodes[e.node_a] for e in edges)
        T_b = se2.stack(self._nodes[e.node_b] for e in edges)
        W = np.stack([e.information for e in edges])
        if weights is not None:
            W = W * np.array([weights.get(e.id, 1.0) for e in edges])[:, None, None]
        J_a = -se2.adjoint(se2.between(T_b, T_a))
        J_a_T = np.swapaxes(J_a, 1, 2)
        a = np.array([self._column.get(e.node_a, -1) for e in edges], dtype=np.int64)
        b = np.array([self._column.get(e.node_b, -1) for e in edges], dtype=np.int64)
        return [(a, a, J_a_T @ W @ J_a), (a, b, J_a_T @ W), (b, a, W @ J_a), (b, b, W)]


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
    covariances = Covariances(nodes, edges, anchor)
    return covariances.of(node) if node2 is None else covariances.relative(node, node2)


def in_map_axes(covariance: NDArray[np.float64], pose: Pose) -> NDArray[np.float64]:
    """Return a covariance in the tangent at `pose` as one of (x, y, theta) in the map's axes."""
    return se2.transport(covariance, np.array([0.0, 0.0, pose.theta]))


def _symmetric(C: NDArray[np.float64]) -> NDArray[np.float64]:
    half: NDArray[np.float64] = 0.5 * (C + C.T)
    return half
