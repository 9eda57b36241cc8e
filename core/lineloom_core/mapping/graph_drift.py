"""How sure the graph is of the relative pose of two keyframes, by drift as it was measured.

Along one track that no loop has touched, drift is the sum of its steps (`drift.Chain`). Where
loops and meetings tie tracks together, it is what the whole graph leaves open: two maps that have
met at one end only are still free to differ at the other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.graph import Covariances, Piece, PoseGraph
from lineloom_core.mapping.keyframe import Keyframe


class GraphDrift:
    """Relative covariances, kept until the graph changes."""

    def __init__(self, graph: PoseGraph, keyframes: dict[int, Keyframe]) -> None:
        self._graph = graph
        self._keyframes = keyframes
        self._known: dict[int, Covariances] = {}
        self._known_at = graph.changes

    def between(self, a: int, b: int) -> NDArray[np.float64]:
        """Covariance (3, 3) of T_a_b, two keyframes of one component, in the tangent at b."""
        if self._known_at != self._graph.changes:
            self._known, self._known_at = {}, self._graph.changes
        root = self._graph.component_root(a)
        if root not in self._known:
            self._known[root] = Covariances(self._as_measured(self._graph.piece(root)), root)
        return self._known[root].relative(a, b)

    def _as_measured(self, piece: Piece) -> Piece:
        """Tracked steps with the drift measured on them; other edges as the graph takes them."""
        tracked = ~piece.robust
        steps = (self._keyframes[k].step for k in piece.ids[piece.ends[tracked, 1]].tolist())
        drifts = [step.drift for step in steps if step is not None]
        measured = np.linalg.inv(np.array(drifts).reshape(-1, 3, 3))
        information = piece.information.copy()
        information[tracked] = 0.5 * (measured + np.swapaxes(measured, 1, 2))
        return replace(piece, information=information)
