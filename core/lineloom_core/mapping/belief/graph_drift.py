"""How sure the graph is of the relative poses of keyframes, by drift as it was measured.

Along one track that no loop has touched, drift is the sum of its steps (`drift.Chain`). Where
loops and meetings tie tracks together, it is what the whole graph leaves open: two maps that have
met at one end only are still free to differ at the other.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import se2
from lineloom_core.graph import PoseGraph
from lineloom_core.mapping.belief.track import Track


class Drifts:
    """Relative covariances among keyframes of one component, worked out at once when asked for.

    tracks: what each of the keyframes is on. looped: the names of tracks that loops have touched.
    A keyframe that was tracked on since the graph was optimised is as sure as the last one before
    it, and the steps from there.
    """

    def __init__(
        self, graph: PoseGraph, tracks: Mapping[int, Track], looped: Container[str]
    ) -> None:
        self._graph, self._tracks, self._looped = graph, tracks, looped
        self._place = {keyframe: place for place, keyframe in enumerate(tracks)}

    def __call__(self, a: int, b: int) -> NDArray[np.float64]:
        """Covariance (3, 3) of T_a_b in the tangent at b."""
        found: NDArray[np.float64] = self.table[self._place[a], self._place[b]]
        return found

    def among(self, keyframes: Sequence[int]) -> NDArray[np.float64]:
        """Those among some of them, (n, n, 3, 3) [a, b]; one may be there several times."""
        at = np.array([self._place[k] for k in keyframes], dtype=np.int64)
        found: NDArray[np.float64] = self.table[at[:, None], at[None, :]]
        return found

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """All of them, (n, n, 3, 3) [a, b], in the order of the keyframes.

        Raises ValueError where the graph was not optimised since tracks were tied together.
        """
        n, keyframes = len(self._tracks), list(self._tracks)
        held = np.array([self._held(k) for k in keyframes], dtype=np.int64)
        table, open_pairs = np.zeros((n, n, 3, 3)), np.ones((n, n), dtype=np.bool_)
        for track in {id(t): t for t in self._tracks.values()}.values():
            own = np.array([i for i, k in enumerate(keyframes) if self._tracks[k] is track])
            chain = track.chain.among([track.position(keyframes[i]) for i in own.tolist()])
            alone = np.full((len(own), len(own)), track.id not in self._looped)
            rows, columns = np.nonzero(alone | (held[own][:, None] == held[own]))
            table[own[rows], own[columns]] = chain[rows, columns]
            open_pairs[own[rows], own[columns]] = False
        if open_pairs.any():
            table[open_pairs] = self._through_the_graph(keyframes, held)[open_pairs]
        return table

    def _held(self, keyframe: int) -> int:
        """The last keyframe up to this one that the graph was optimised with, -1 if there is none.

        That is one of the same track: what is tracked on hangs on nothing else.
        """
        if self._graph.is_solved(keyframe):
            return keyframe
        track = self._tracks[keyframe]
        earlier = reversed(track.kept[: track.kept_position(keyframe)])
        return next((k for k in earlier if self._graph.is_solved(k)), -1)

    def _through_the_graph(
        self, keyframes: list[int], held: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """By way of the keyframes held: to the first, on to the second, and on from there.

        T_a_b = T_a_h T_h_g T_g_b with a held by h and b by g; covariances are carried to b.
        """
        if held.min() < 0:
            raise ValueError("tracks were tied together, and the graph not optimised since")
        known, place = np.unique(held, return_inverse=True)
        between = self._graph.drift(known.tolist())[place[:, None], place[None, :]]
        poses, ends = (
            se2.stack(self._graph.pose(k) for k in nodes) for nodes in (keyframes, held.tolist())
        )
        back, onward = np.zeros((2, len(keyframes), 3, 3))
        for i, (k, h) in enumerate(zip(keyframes, held.tolist(), strict=True)):
            if h != k:
                back[i], onward[i] = self._tracks[k].drift(k, h), self._tracks[k].drift(h, k)
        T_b_h = se2.between(poses[None, :], ends[:, None])  # [a, b]: from b to what holds a
        T_b_g = se2.between(poses, ends)
        carried = se2.transport(between, T_b_g[None, :]) + se2.transport(back[:, None], T_b_h)
        return np.asarray(carried + onward[None, :])
