"""The pose graph: keyframes, what is measured between them, and the current estimate."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from lineloom_core.geometry import Pose
from lineloom_core.graph.components import Components
from lineloom_core.graph.edge import Edge, chi_squared


class PoseGraph:
    """Nodes with poses and edges with measurements; plain data, made to be pickled.

    Node poses live in the frame of their component. Adding keeps the components up to date at
    almost no cost; removing an edge makes the next question about components count them anew
    (milliseconds at 10,000 edges). Solving is `solver.optimize`'s business.
    """

    def __init__(self) -> None:
        self._nodes: dict[int, Pose] = {}
        self._edges: dict[str, Edge] = {}
        self._edges_at: dict[int, dict[str, None]] = {}  # a dict for its order: sets have none
        self._components: Components | None = Components()

    @property
    def nodes(self) -> Mapping[int, Pose]:
        """Pose estimate by node id, in order of insertion (read only)."""
        return MappingProxyType(self._nodes)

    @property
    def edges(self) -> Mapping[str, Edge]:
        """Edge by id, in order of insertion (read only)."""
        return MappingProxyType(self._edges)

    def add_node(self, node: int, pose: Pose) -> None:
        """Add a node. Raises ValueError if it is there already."""
        if node in self._nodes:
            raise ValueError(f"node {node} is in the graph already")
        self._nodes[node] = pose
        self._edges_at[node] = {}
        if self._components is not None:
            self._components.add(node)

    def set_poses(self, poses: Mapping[int, Pose]) -> None:
        """Take new estimates for some or all nodes. Raises KeyError for an unknown node."""
        for node, pose in poses.items():
            if node not in self._nodes:
                raise KeyError(f"node {node} is not in the graph")
            self._nodes[node] = pose

    def move_component(self, node: int, T_new_old: Pose) -> None:
        """Move every node of the node's component rigidly: pose <- T_new_old pose."""
        for member in self.component_of(node):
            self._nodes[member] = T_new_old @ self._nodes[member]

    def add_edge(self, edge: Edge) -> None:
        """Add an edge. Raises ValueError for a known id, KeyError for an unknown node."""
        if edge.id in self._edges:
            raise ValueError(f"edge {edge.id} is in the graph already")
        for node in (edge.node_a, edge.node_b):
            if node not in self._nodes:
                raise KeyError(f"edge {edge.id}: node {node} is not in the graph")
        self._edges[edge.id] = edge
        self._edges_at[edge.node_a][edge.id] = None
        self._edges_at[edge.node_b][edge.id] = None
        if self._components is not None:
            self._components.join(edge.node_a, edge.node_b)

    def remove_edge(self, edge_id: str) -> Edge:
        """Remove an edge and return it. Raises KeyError if there is none of this id."""
        if edge_id not in self._edges:
            raise KeyError(f"edge {edge_id} is not in the graph")
        edge = self._edges.pop(edge_id)
        del self._edges_at[edge.node_a][edge_id]
        del self._edges_at[edge.node_b][edge_id]
        self._components = None
        return edge

    def remove_node(self, node: int) -> tuple[Edge, ...]:
        """Remove a node with all its edges; return those edges. Raises KeyError if unknown."""
        if node not in self._nodes:
            raise KeyError(f"node {node} is not in the graph")
        removed = tuple(self.remove_edge(edge_id) for edge_id in list(self._edges_at[node]))
        del self._nodes[node], self._edges_at[node]
        self._components = None
        return removed

    def edges_at(self, node: int) -> tuple[Edge, ...]:
        """Return the edges that touch a node, in order of insertion."""
        return tuple(self._edges[edge_id] for edge_id in self._edges_at[node])

    def components(self) -> tuple[tuple[int, ...], ...]:
        """Return the connected sets of nodes, each sorted, ordered by their smallest node."""
        return self._connected().sets()

    def component_root(self, node: int) -> int:
        """Return the smallest node of the node's component: its natural name and anchor."""
        return self._connected().root(node)

    def component_of(self, node: int) -> tuple[int, ...]:
        """Return the nodes connected with this one, itself included, sorted."""
        seen: dict[int, None] = {node: None}
        queue = [node]
        while queue:
            for edge_id in self._edges_at[queue.pop()]:
                edge = self._edges[edge_id]
                for other in (edge.node_a, edge.node_b):
                    if other not in seen:
                        seen[other] = None
                        queue.append(other)
        return tuple(sorted(seen))

    def connected(self, a: int, b: int) -> bool:
        """Tell whether edges lead from a to b."""
        components = self._connected()
        return components.root(a) == components.root(b)

    def subgraph(self, nodes: Iterable[int]) -> tuple[dict[int, Pose], list[Edge]]:
        """Return the poses of `nodes` and the edges among them, as `solver.optimize` takes them."""
        poses = {node: self._nodes[node] for node in nodes}
        ids: dict[str, None] = {}
        for node in poses:
            for edge_id in self._edges_at[node]:
                edge = self._edges[edge_id]
                if edge.node_a in poses and edge.node_b in poses:
                    ids[edge_id] = None
        return poses, [self._edges[edge_id] for edge_id in ids]

    def component_subgraph(self, node: int) -> tuple[dict[int, Pose], list[Edge]]:
        """Return the poses and edges of the node's component."""
        return self.subgraph(self.component_of(node))

    def residual(self, edge: Edge | str) -> float:
        """Return the whitened norm of an edge's error at the current estimate.

        `edge` may be one that is not (yet) in the graph, as long as its nodes are.
        """
        chosen = self._edges[edge] if isinstance(edge, str) else edge
        return math.sqrt(float(chi_squared([chosen], self._nodes)[0]))

    def residuals(self) -> dict[str, float]:
        """Return the whitened norm of every edge's error at the current estimate, by id."""
        chi2 = chi_squared(list(self._edges.values()), self._nodes)
        return {edge_id: math.sqrt(float(c)) for edge_id, c in zip(self._edges, chi2, strict=True)}

    def _connected(self) -> Components:
        if self._components is None:
            links = ((edge.node_a, edge.node_b) for edge in self._edges.values())
            self._components = Components(self._nodes, links)
        return self._components
