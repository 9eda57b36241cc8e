"""One connected piece of a pose graph as arrays: what the solver's inner loops run over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from lineloom_core.geometry import Pose, se2
from lineloom_core.graph.edge import Edge
from lineloom_core.graph.pose_table import PoseTable


@dataclass(frozen=True, eq=False, slots=True)
class Piece:
    """Nodes by rows, and the edges among them.

    ids: (n,) node ids, ascending. poses: (n, 3) x, y, theta [m, m, rad]. ends: (m, 2) rows of each
    edge's nodes a and b. measured: (m, 3) T_a_b. information: (m, 3, 3) in the tangent at b.
    robust: (m,).
    """

    ids: NDArray[np.int64]
    poses: NDArray[np.float64]
    ends: NDArray[np.int64]
    measured: NDArray[np.float64]
    information: NDArray[np.float64]
    robust: NDArray[np.bool_]

    @classmethod
    def of(cls, nodes: Mapping[int, Pose], edges: Sequence[Edge]) -> Piece:
        """Build from plain objects. Raises KeyError for an edge whose node is missing."""
        ids = sorted(nodes)
        row = {node: i for i, node in enumerate(ids)}
        ends = [(row[e.node_a], row[e.node_b]) for e in edges]
        return cls(
            ids=np.array(ids, dtype=np.int64),
            poses=se2.stack(nodes[node] for node in ids),
            ends=np.array(ends, dtype=np.int64).reshape(-1, 2),
            measured=se2.stack(e.T_a_b for e in edges),
            information=np.array([e.information for e in edges]).reshape(-1, 3, 3),
            robust=np.array([e.robust for e in edges], dtype=np.bool_),
        )

    def row(self, node: int) -> int:
        """Row of a node. Raises KeyError where it is not in the piece."""
        row = int(np.searchsorted(self.ids, node))
        if row == len(self.ids) or self.ids[row] != node:
            raise KeyError(f"node {node} is not in the piece")
        return row

    def moved(self, T_new_old: Pose) -> Piece:
        """The piece in another frame, its edges as they were."""
        return replace(self, poses=se2.compose(T_new_old.to_array(), self.poses))

    def with_edges(self, edges: Sequence[Edge]) -> Piece:
        """The piece and more edges among its nodes. Raises KeyError for an unknown node."""
        ends = [(self.row(e.node_a), self.row(e.node_b)) for e in edges]
        measured, information = se2.stack(e.T_a_b for e in edges), [e.information for e in edges]
        return replace(
            self,
            ends=np.concatenate([self.ends, np.array(ends, dtype=np.int64).reshape(-1, 2)]),
            measured=np.concatenate([self.measured, measured]),
            information=np.concatenate([self.information, np.reshape(information, (-1, 3, 3))]),
            robust=np.concatenate([self.robust, np.array([e.robust for e in edges], np.bool_)]),
        )

    def part(self, rows: NDArray[np.int64]) -> Piece:
        """The nodes of these rows and the edges among them, nodes by ascending id."""
        rows = rows[np.argsort(self.ids[rows], kind="stable")]
        new_row = np.full(len(self.ids), -1, dtype=np.int64)
        new_row[rows] = np.arange(len(rows))
        ends = new_row[self.ends]
        inside = (ends >= 0).all(axis=1)
        return Piece(
            ids=self.ids[rows],
            poses=self.poses[rows],
            ends=ends[inside],
            measured=self.measured[inside],
            information=self.information[inside],
            robust=self.robust[inside],
        )

    def table(self, poses: NDArray[np.float64]) -> Mapping[int, Pose]:
        """Other poses (n, 3) of the piece's nodes, by node id."""
        return PoseTable({node: i for i, node in enumerate(self.ids.tolist())}, poses)

    def errors(self) -> NDArray[np.float64]:
        """Log(measured^-1 T_a_b) of every edge, (m, 3)."""
        T_a_b = se2.between(self.poses[self.ends[:, 0]], self.poses[self.ends[:, 1]])
        return se2.log(se2.between(self.measured, T_a_b))

    def chi2(self) -> NDArray[np.float64]:
        """Squared whitened error of every edge, (m,), robust kernels left aside."""
        errors = self.errors()
        squared = np.einsum("ni,nij,nj->n", errors, self.information, errors)
        chi2: NDArray[np.float64] = np.maximum(squared, 0.0)
        return chi2

    def connected(self) -> list[NDArray[np.int64]]:
        """Rows of each connected set, ordered by the smallest id in them."""
        names = labels(self.ids, self.ends)
        return [np.flatnonzero(names == name) for name in np.unique(names)]


def together(first: Piece, second: Piece) -> Piece:
    """Two pieces without a common node, in one frame, side by side."""
    both = Piece(
        ids=np.concatenate([first.ids, second.ids]),
        poses=np.concatenate([first.poses, second.poses]),
        ends=np.concatenate([first.ends, second.ends + len(first.ids)]),
        measured=np.concatenate([first.measured, second.measured]),
        information=np.concatenate([first.information, second.information]),
        robust=np.concatenate([first.robust, second.robust]),
    )
    return both.part(np.arange(len(both.ids)))


def labels(ids: NDArray[np.int64], ends: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return for every node the smallest id that edges connect it with, shape (n,)."""
    if not len(ids):
        return np.zeros(0, dtype=np.int64)
    links = (np.ones(len(ends), dtype=np.int8), (ends[:, 0], ends[:, 1]))
    shape = (len(ids), len(ids))
    sets, member = connected_components(scipy.sparse.coo_matrix(links, shape=shape), directed=False)
    smallest = np.full(sets, np.iinfo(np.int64).max)
    np.minimum.at(smallest, member, ids)
    named: NDArray[np.int64] = smallest[member]
    return named
