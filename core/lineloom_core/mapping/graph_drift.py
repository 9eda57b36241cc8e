"""How sure the graph is of the relative pose of two keyframes, by drift as it was measured.

Along one track that no loop has touched, drift is the sum of its steps (`drift.Chain`). Where
loops and meetings tie tracks together, it is what the whole graph leaves open: two maps that have
met at one end only are still free to differ at the other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.graph import Covariances, Edge, PoseGraph
from lineloom_core.mapping.keyframe import Keyframe


class GraphDrift:
    """Relative covariances, kept until the graph changes."""

    def __init__(self, graph: PoseGraph, keyframes: dict[int, Keyframe]) -> None:
        self._graph = graph
        self._keyframes = keyframes
        self._known: dict[int, Covariances] = {}

    def forget(self) -> None:
        """The graph has changed."""
        self._known.clear()

    def between(self, a: int, b: int) -> NDArray[np.float64]:
        """Covariance (3, 3) of T_a_b, two keyframes of one component, in the tangent at b."""
        root = self._graph.component_root(a)
        if root not in self._known:
            nodes, edges = self._graph.component_subgraph(root)
            self._known[root] = Covariances(nodes, [self._as_measured(e) for e in edges], root)
        return self._known[root].relative(a, b)

    def _as_measured(self, edge: Edge) -> Edge:
        """A tracked step with the drift measured on it; another edge as the graph takes it."""
        step = self._keyframes[edge.node_b].step
        if edge.kind != "sequential" or step is None:
            return edge
        information = np.linalg.inv(step.drift)
        return replace(edge, information=0.5 * (information + information.T))
