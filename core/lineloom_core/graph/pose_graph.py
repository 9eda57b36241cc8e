"""The pose graph: keyframes, what is measured between them, and the current estimate.

Each component is one Bayes tree of gtsam's (`BayesTree`), as of the last time that it was
optimised. Keyframes and edges that came since wait: a keyframe that is tracked on lies where its
step leads, and nothing else moves by it. How the tree came to be is kept (`Epoch`).
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import gtsam
import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph.bayes_tree import UnsettledError
from lineloom_core.graph.edge import Edge, EdgeKind
from lineloom_core.graph.epoch import Epoch
from lineloom_core.graph.growth import Growth, together
from lineloom_core.graph.labels import labels
from lineloom_core.graph.pose_table import PoseTable
from lineloom_core.graph.solver import settle
from lineloom_core.graph.trees import Trees
from lineloom_core.graph.trial import Trial
from lineloom_core.growing import GrowingArray
from lineloom_core.timing import timed


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
    drift=NDArray[np.float64],
    robust=NDArray[np.bool_],
    trees=Trees,
)
class PoseGraph:
    """Nodes with poses and edges with measurements, as objects and as arrays; made to be stored.

    Node poses live in the frame of their component, whose smallest node keeps its pose.
    """

    def __init__(self) -> None:
        self._row_of: dict[int, int] = {}
        self._ids = GrowingArray(np.int64)
        self._poses = GrowingArray(np.float64, (3,))
        self._labels = GrowingArray(np.int64)
        """The smallest node id of each node's component."""
        self._edges: dict[str, Edge] = {}
        self._trees = Trees()
        self.solved: tuple[gtsam.NonlinearFactorGraph, ...] = ()
        """Of a settled graph: gtsam's graph of each component, with all of its factors."""
        self._clear_edges()

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
            "drift": self._drift.rows,
            "robust": self._robust.rows,
            "trees": self._trees,
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
            state["information"].copy(),
            state["robust"].tolist(),
            state["drift"].copy(),
        )
        for name, kind, (a, b), measured, *rest in zip(*columns, strict=True):
            edge = Edge(name, kind, ids[a], ids[b], Pose(*measured), *rest)
            self._edges[name] = edge
            self._list_edge(edge)
        self._labels.rows[:] = state["labels"]
        self._trees = state["trees"]

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

    def move_component(self, node: int, T_new_old: Pose) -> None:
        """Move every node of the node's component rigidly: pose <- T_new_old pose."""
        root = self.component_root(node)
        members, poses = self._labels.rows == root, self._poses.rows
        poses[members] = se2.compose(T_new_old.to_array(), poses[members])
        self._trees.forget(root)

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
            self._trees.join(min(a, b), max(a, b))
        self._trees.enter(min(a, b), edge.id)

    def remove_edge(self, edge_id: str) -> Edge:
        """Remove an edge and return it. Raises KeyError if there is none of this id."""
        if edge_id not in self._edges:
            raise KeyError(f"edge {edge_id} is not in the graph")
        (edge,) = self._drop_edges({edge_id: None})
        self._relabel()
        return edge

    def remove_nodes(
        self, nodes: Collection[int], instead: Sequence[Edge] = ()
    ) -> tuple[Edge, ...]:
        """Remove nodes with all their edges; return those. Raises KeyError for an unknown node.

        instead: edges of what stays, which enter in their place: nothing falls apart in between.
        """
        gone = frozenset(nodes)
        removed = self._drop_edges(
            {edge.id: None for node in nodes for edge in self._edges_at[node]}
        )
        for node in nodes:
            self._trees.lose(self.component_root(node), node)
        for edge in instead:
            self._edges[edge.id] = edge
            self._list_edge(edge)
            self._trees.enter(self.component_root(edge.node_a), edge.id)
        kept = [node not in gone for node in self._row_of]
        self._ends.rows[:] = (np.cumsum(kept) - 1)[self._ends.rows]
        for rows in (self._ids, self._poses, self._labels):
            rows.keep(kept)
        self._row_of = {node: row for row, node in enumerate(self._ids.rows.tolist())}
        for node in gone:
            del self._edges_at[node]
        self._relabel()
        return removed

    @timed("optimise")
    def optimise(self, node: int) -> None:
        """Let the tree of the node's component take what has come and gone since it did last.

        Estimates then are within millimetres of the optimum; `settled` is exact.
        """
        root, trees = self.component_root(node), self._trees
        if not any(root in rows for rows in (trees.waiting, trees.leaving)):
            return
        epoch = trees.epochs.get(root)
        try:
            if epoch is None or epoch.is_over:
                epoch = Epoch(root, self._component(root))
                found = epoch.estimates()
                trees.begin(epoch)
            else:
                found = trees.take(root, self._news(root)).estimates()
        except UnsettledError:
            trees.forget(root)
            trial = Trial.from_optimum(root, self._component(root))
            trees.begin(trial.epoch)
            found = trial.ids, trial.rows
        self._take_poses(*found)

    def _news(self, root: int) -> Growth:
        """What waits to enter and to leave a component's tree."""
        trees, inside = self._trees, self._trees.epochs[root].nodes
        edges = [self._edges[name] for name in trees.waiting.get(root, ())]
        ends = dict.fromkeys(node for e in edges for node in (e.node_a, e.node_b))
        fresh = [node for node in ends if node not in inside]
        poses = self._poses.rows[[self._row_of[node] for node in fresh]]
        leaving, gone = trees.leaving.get(root, ()), trees.gone.get(root, ())
        return Growth.of(np.array(fresh, np.int64), poses, edges, leaving, gone)

    def solve_joined(self, a: int, b: int, T_A_B: Pose, edges: Sequence[Edge]) -> Trial:
        """What the components of nodes a and b would come to with these edges between them.

        In the frame of a's, into which T_A_B carries the other; changes nothing.
        """
        own, other = (self._component(self.component_root(node)) for node in (a, b))
        both = together(own, other.moved(T_A_B), edges)
        return Trial.of(min(self.component_root(node) for node in (a, b)), both)

    def adopt(self, trial: Trial) -> None:
        """Go on from a trial whose edges have entered since."""
        self._trees.begin(trial.epoch)
        self._take_poses(trial.ids, trial.rows)

    def settled(self) -> PoseGraph:
        """The same graph at the optimum of all of its factors; to look at, not to go on from."""
        rest = PoseGraph.__new__(PoseGraph)
        rest.__dict__.update(self.__dict__)
        rest._poses = copy.deepcopy(self._poses)
        for root in np.unique(self._labels.rows).tolist():
            component = self._component(root)
            poses, factors = settle(component, root)
            rest._take_poses(np.sort(component.ids), poses)
            rest.solved += (factors,)
        return rest

    def is_solved(self, node: int) -> bool:
        """Whether a node was there when its component was last optimised."""
        epoch = self._trees.epochs.get(self.component_root(node))
        return epoch is not None and node in epoch.nodes

    def drift(self, nodes: Sequence[int]) -> NDArray[np.float64]:
        """Covariances of T_a_b among solved nodes of one component, (n, n, 3, 3), at b.

        By their edges' `drift_information`. Raises KeyError for nodes that were not solved.
        """
        return self._trees.epochs[self.component_root(nodes[0])].drift(nodes)

    def factors(self) -> frozenset[str]:
        """Edges that are factors of a Bayes tree."""
        return frozenset(name for epoch in self._trees.epochs.values() for name in epoch.numbers)

    def edges_at(self, node: int) -> tuple[Edge, ...]:
        """Return the edges that touch a node, in order of insertion."""
        return tuple(self._edges_at[node])

    def component_root(self, node: int) -> int:
        """Return the smallest node of the node's component: its natural name and anchor."""
        return int(self._labels.rows[self._row_of[node]])

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

    def errors(self) -> NDArray[np.float64]:
        """Return Log(measured^-1 T_a_b) of all edges at the current estimate, (m, 3)."""
        poses, ends = self._poses.rows, self._ends.rows
        T_a_b = se2.between(poses[ends[:, 0]], poses[ends[:, 1]])
        return se2.log(se2.between(self._measured.rows, T_a_b))

    def residuals(self) -> dict[str, float]:
        """Return the whitened norm of every edge's error at the current estimate, by id."""
        errors = self.errors()
        chi2 = np.einsum("ni,nij,nj->n", errors, self._information.rows, errors)
        return dict(zip(self._edges, np.sqrt(np.maximum(chi2, 0.0)).tolist(), strict=True))

    def _component(self, root: int) -> Growth:
        """A whole component, its edges in order of insertion."""
        labels, ids = self._labels.rows, self._ids.rows
        members, inside = labels == root, labels[self._ends.rows[:, 0]] == root
        return Growth(
            ids=ids[members],
            poses=self._poses.rows[members],
            names=tuple(n for n, chosen in zip(self._edges, inside, strict=True) if chosen),
            ends=ids[self._ends.rows[inside]],
            measured=self._measured.rows[inside],
            information=self._information.rows[inside],
            drift_information=self._drift.rows[inside],
            robust=self._robust.rows[inside],
        )

    def _take_poses(self, ids: NDArray[np.int64], poses: NDArray[np.float64]) -> None:
        """Take new estimates (n, 3); a component's smallest node keeps its own, to the last bit."""
        by_id = np.argsort(self._ids.rows, kind="stable")
        rows = by_id[np.searchsorted(self._ids.rows, ids, sorter=by_id)]
        free = self._labels.rows[rows] != ids
        self._poses.rows[rows[free]] = poses[free]

    def _clear_edges(self) -> None:
        self._edges_at: dict[int, list[Edge]] = {node: [] for node in self._row_of}
        self._ends = GrowingArray(np.int64, (2,))
        self._measured = GrowingArray(np.float64, (3,))
        self._information = GrowingArray(np.float64, (3, 3))
        self._drift = GrowingArray(np.float64, (3, 3))
        self._robust = GrowingArray(np.bool_)

    def _drop_edges(self, names: Mapping[str, None]) -> tuple[Edge, ...]:
        kept = [name not in names for name in self._edges]
        for rows in (self._ends, self._measured, self._information, self._drift, self._robust):
            rows.keep(kept)
        dropped = tuple(self._edges.pop(name) for name in names)
        for edge in dropped:
            self._trees.leave(self.component_root(edge.node_a), edge.id)
            self._edges_at[edge.node_a].remove(edge)
            self._edges_at[edge.node_b].remove(edge)
        return dropped

    def _relabel(self) -> None:
        before = self._labels.rows.copy()
        self._labels.rows[:] = labels(self._ids.rows, self._ends.rows)
        apart = set(before[before != self._labels.rows].tolist())
        apart |= self._trees.epochs.keys() - self._row_of.keys()
        self._trees.split(apart, lambda name: self.component_root(self._edges[name].node_a))

    def _list_edge(self, edge: Edge) -> None:
        self._edges_at[edge.node_a].append(edge)
        self._edges_at[edge.node_b].append(edge)
        self._ends.append((self._row_of[edge.node_a], self._row_of[edge.node_b]))
        self._measured.append((edge.T_a_b.x, edge.T_a_b.y, edge.T_a_b.theta))
        self._information.append(edge.information)
        self._drift.append(edge.drift_information)
        self._robust.append(edge.robust)
