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
from lineloom_core.growing import GrowingArray
from lineloom_core.mapping.facts.keyframe import Keyframe, Step

_ROOM = 64
"""Rows that are not worth tidying up."""


class GraphDrift:
    """Relative covariances, kept until the graph changes."""

    def __init__(self, graph: PoseGraph, keyframes: dict[int, Keyframe]) -> None:
        self._graph = graph
        self._keyframes = keyframes
        self._known: dict[int, Covariances] = {}
        self._known_at = graph.changes
        self._rows: dict[int, tuple[Step, int]] = {}
        self._steps = GrowingArray(np.float64, (3, 3))
        """Information of steps as measured, by row."""

    def between(self, a: int, b: int) -> NDArray[np.float64]:
        """Covariance (3, 3) of T_a_b, two keyframes of one component, in the tangent at b."""
        if self._known_at != self._graph.changes:
            self._known, self._known_at = {}, self._graph.changes
            self._forget_what_was_let_go()
        root = self._graph.component_root(a)
        if root not in self._known:
            self._known[root] = Covariances(self._as_measured(self._graph.piece(root)), root)
        return self._known[root].relative(a, b)

    def _as_measured(self, piece: Piece) -> Piece:
        """Tracked steps with the drift measured on them; other edges as the graph takes them."""
        tracked = ~piece.robust
        rows = [self._row(k) for k in piece.ids[piece.ends[tracked, 1]].tolist()]
        information = piece.information.copy()
        information[tracked] = self._steps.rows[rows]
        return replace(piece, information=information)

    def _forget_what_was_let_go(self) -> None:
        if len(self._steps) > _ROOM + 2 * len(self._keyframes):
            self._rows, self._steps = {}, GrowingArray(np.float64, (3, 3))

    def _row(self, keyframe: int) -> int:
        """Row of the step that leads to a keyframe."""
        step = self._keyframes[keyframe].step
        assert step is not None, "a tracked edge without a step"
        known = self._rows.get(keyframe)
        if known is not None and known[0] is step:
            return known[1]
        information = np.linalg.inv(step.drift)
        self._steps.append(0.5 * (information + information.T))
        self._rows[keyframe] = step, len(self._steps) - 1
        return len(self._steps) - 1
