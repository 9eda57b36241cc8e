"""The pose graph: keyframes, what is measured between them, and the current estimate."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph.edge import Edge, EdgeKind
from lineloom_core.graph.piece import Piece, labels
from lineloom_core.graph.pose_table import PoseTable
from lineloom_core.growing import GrowingArray


@storable(
    "pose-graph",
    ids=NDArray[np.int64],
    poses=NDArray[np.float64],
    labels=NDArray[np.int64],
    names=list[str],
    kinds=list[EdgeKind],
    ends=NDArray[np.int64],
    measured=NDArray[np.float64],
    information=NDArray[np.float64],
    robust=NDArray[np.bool_],
    changes=int,
)
class PoseGraph:
    """Nodes with poses and edges with measurements, as objects and as arrays; made to be stored.

    Node poses live in the frame of their component. All that the solver takes is kept in arrays
    while the graph grows and shrinks. Solving is `solver.settle`'s business.
    """

    def __init__(self) -> None:
        self._row_of: dict[int, int] = {}
        self._ids = GrowingArray(np.int64)
        self._poses = GrowingArray(np.float64, (3,))
        self._labels = GrowingArray(np.int64)
        """The smallest node id of each node's component."""
        self._edges: dict[str, Edge] = {}
        self._clear_edges()
        self.changes = 0
        """Grows with every change; the same number means the same graph."""

    def __getstate__(self) -> dict[str, Any]:
        """Edges follow from the arrays, their ids and kinds."""
        return {
            "ids": self._ids.rows,
            "poses": self._poses.rows,
            "labels": self._labels.rows,
            "names": list(self._edges),
            "kinds": [edge.kind for edge in self._edges.values()],
            "ends": self._ends.rows,
            "measured": self._measured.rows,
            "information": self._information.rows,
            "robust": self._robust.rows,
            "changes": self.changes,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Raises ValueError where the arrays do not fit each other."""
        self.__init__()  # type: ignore[misc]
        ids = state["ids"].tolist()
        for node, pose in zip(ids, state["poses"].tolist(), strict=True):
            self.add_node(node, Pose(*pose))
        columns = (
            state["names"],
            state["kinds"],
            state["ends"].tolist(),
            state["measured"].tolist(),
            state["information"],
            state["robust"].tolist(),
        )
        for name, kind, (a, b), measured, information, robust in zip(*columns, strict=True):
            edge = Edge(name, kind, ids[a], ids[b], Pose(*measured), information.copy(), robust)
            self._edges[name] = edge
            self._list_edge(edge)
        self._labels.rows[:] = state["labels"]
        self.changes = state["changes"]

    @property
    def nodes(self) -> Mapping[int, Pose]:
        """Pose estimate by node id, in order of insertion (read only)."""
        return PoseTable(self._row_of, self._poses.rows)

    @property
    def edges(self) -> Mapping[str, Edge]:
        """Edge by id, in order of insertion (read only)."""
        return MappingProxyType(self._edges)

    def estimates(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Ids of all nodes (n,) and their pose estimates (n, 3), as copies."""
        return self._ids.rows.copy(), self._poses.rows.copy()

    def pose(self, node: int) -> Pose:
        """Pose estimate of a node. Raises KeyError for an unknown one."""
        return Pose(*self._poses.rows[self._row_of[node]].tolist())

    def add_node(self, node: int, pose: Pose) -> None:
        """Add a node. Raises ValueError if it is there already."""
        if node in self._row_of:
            raise ValueError(f"node {node} is in the graph already")
        self._row_of[node] = len(self._ids)
        self._ids.append(node)
        self._poses.append((pose.x, pose.y, pose.theta))
        self._labels.append(node)
        self._edges_at[node] = []
        self.changes += 1

    def take_poses(self, piece: Piece, poses: NDArray[np.float64]) -> None:
        """Take new estimates (n, 3) for the nodes of a piece."""
        rows = [self._row_of[node] for node in piece.ids.tolist()]
        self._poses.rows[rows] = poses
        self.changes += 1

    def move_component(self, node: int, T_new_old: Pose) -> None:
        """Move every node of the node's component rigidly: pose <- T_new_old pose."""
        members = self._labels.rows == self.component_root(node)
        poses = self._poses.rows
        poses[members] = se2.compose(T_new_old.to_array(), poses[members])
        self.changes += 1

    def add_edge(self, edge: Edge) -> None:
        """Add an edge. Raises ValueError for a known id, KeyError for an unknown node."""
        if edge.id in self._edges:
            raise ValueError(f"edge {edge.id} is in the graph already")
        for node in (edge.node_a, edge.node_b):
            if node not in self._row_of:
                raise KeyError(f"edge {edge.id}: node {node} is not in the graph")
        self._edges[edge.id] = edge
        self._list_edge(edge)
        a, b = self.component_root(edge.node_a), self.component_root(edge.node_b)
        if a != b:
            names = self._labels.rows
            names[names == max(a, b)] = min(a, b)
        self.changes += 1

    def remove_edge(self, edge_id: str) -> Edge:
        """Remove an edge and return it. Raises KeyError if there is none of this id."""
        if edge_id not in self._edges:
            raise KeyError(f"edge {edge_id} is not in the graph")
        (edge,) = self._drop_edges({edge_id: None})
        self._relabel()
        return edge

    def remove_nodes(self, nodes: Collection[int]) -> tuple[Edge, ...]:
        """Remove nodes with all their edges; return those. Raises KeyError for an unknown node."""
        gone = frozenset(nodes)
        removed = self._drop_edges(
            {edge.id: None for node in nodes for edge in self._edges_at[node]}
        )
        kept = [node not in gone for node in self._row_of]
        self._ends.rows[:] = (np.cumsum(kept) - 1)[self._ends.rows]
        for rows in (self._ids, self._poses, self._labels):
            rows.keep(kept)
        self._row_of = {node: row for row, node in enumerate(self._ids.rows.tolist())}
        for node in gone:
            del self._edges_at[node]
        self._relabel()
        return removed

    def edges_at(self, node: int) -> tuple[Edge, ...]:
        """Return the edges that touch a node, in order of insertion."""
        return tuple(self._edges_at[node])

    def components(self) -> tuple[tuple[int, ...], ...]:
        """Return the connected sets of nodes, each sorted, ordered by their smallest nodes."""
        return tuple(self.component_of(root) for root in np.unique(self._labels.rows).tolist())

    def component_root(self, node: int) -> int:
        """Return the smallest node of the node's component: its natural name and anchor."""
        return int(self._labels.rows[self._row_of[node]])

    def component_of(self, node: int) -> tuple[int, ...]:
        """Return the nodes connected with this one, itself included, sorted."""
        inside = self._labels.rows == self.component_root(node)
        return tuple(np.sort(self._ids.rows[inside]).tolist())

    def connected(self, a: int, b: int) -> bool:
        """Tell whether edges lead from a to b."""
        return self.component_root(a) == self.component_root(b)

    def within(self, node: int, radius: float) -> list[tuple[int, float]]:
        """Nodes of the node's component within `radius` m, nearest first (then by id).

        With their distances; without the node itself.
        """
        row = self._row_of[node]
        offset = self._poses.rows[:, :2] - self._poses.rows[row, :2]
        distance = np.hypot(offset[:, 0], offset[:, 1])
        near = (distance <= radius) & (self._labels.rows == self._labels.rows[row])
        near[row] = False
        rows = np.flatnonzero(near)
        rows = rows[np.lexsort((self._ids.rows[rows], distance[rows]))]
        return list(zip(self._ids.rows[rows].tolist(), distance[rows].tolist(), strict=True))

    def piece(self, node: int) -> Piece:
        """Return the node's component as the solver takes it, edges in order of insertion."""
        return self._whole().part(np.flatnonzero(self._labels.rows == self.component_root(node)))

    def errors(self) -> NDArray[np.float64]:
        """Return Log(measured^-1 T_a_b) of all edges at the current estimate, (m, 3)."""
        return self._whole().errors()

    def residuals(self) -> dict[str, float]:
        """Return the whitened norm of every edge's error at the current estimate, by id."""
        norms = np.sqrt(self._whole().chi2()).tolist()
        return dict(zip(self._edges, norms, strict=True))

    def _whole(self) -> Piece:
        return Piece(
            ids=self._ids.rows,
            poses=self._poses.rows,
            ends=self._ends.rows,
            measured=self._measured.rows,
            information=self._information.rows,
            robust=self._robust.rows,
        )

    def _clear_edges(self) -> None:
        self._edges_at: dict[int, list[Edge]] = {node: [] for node in self._row_of}
        self._ends = GrowingArray(np.int64, (2,))
        self._measured = GrowingArray(np.float64, (3,))
        self._information = GrowingArray(np.float64, (3, 3))
        self._robust = GrowingArray(np.bool_)

    def _drop_edges(self, names: Mapping[str, None]) -> tuple[Edge, ...]:
        kept = [name not in names for name in self._edges]
        for rows in (self._ends, self._measured, self._information, self._robust):
            rows.keep(kept)
        dropped = tuple(self._edges.pop(name) for name in names)
        for edge in dropped:
            self._edges_at[edge.node_a].remove(edge)
            self._edges_at[edge.node_b].remove(edge)
        return dropped

    def _relabel(self) -> None:
        self._labels.rows[:] = labels(self._ids.rows, self._ends.rows)
        self.changes += 1

    def _list_edge(self, edge: Edge) -> None:
        self._edges_at[edge.node_a].append(edge)
        self._edges_at[edge.node_b].append(edge)
        self._ends.append((self._row_of[edge.node_a], self._row_of[edge.node_b]))
        self._measured.append((edge.T_a_b.x, edge.T_a_b.y, edge.T_a_b.theta))
        self._information.append(edge.information)
        self._robust.append(edge.robust)
