"""Where all keyframes are, as one array: neighbours of a point without walking the graph."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose


class Positions:
    """Keyframe ids and positions, in order of insertion; grows by doubling."""

    def __init__(self) -> None:
        self._ids: NDArray[np.int64] = np.empty(64, dtype=np.int64)
        self._xy: NDArray[np.float64] = np.empty((64, 2))
        self._count = 0

    def add(self, keyframe: int, pose: Pose) -> None:
        """Append one keyframe."""
        if self._count == len(self._ids):
            self._ids = np.concatenate([self._ids, np.empty_like(self._ids)])
            self._xy = np.concatenate([self._xy, np.empty_like(self._xy)])
        self._ids[self._count] = keyframe
        self._xy[self._count] = pose.x, pose.y
        self._count += 1

    def reset(self, poses: Mapping[int, Pose]) -> None:
        """Take all keyframes anew: after solving, everything may have moved."""
        self._count = 0
        for keyframe, pose in poses.items():
            self.add(keyframe, pose)

    def within(self, here: Pose, radius: float) -> list[tuple[int, float]]:
        """Keyframes within `radius` m of a pose, nearest first (then by id), with distances.

        Knows nothing of components: positions of different ones do not compare.
        """
        offset = self._xy[: self._count] - (here.x, here.y)
        distance = np.hypot(offset[:, 0], offset[:, 1])
        near = np.flatnonzero(distance <= radius)
        order = near[np.lexsort((self._ids[near], distance[near]))]
        return list(zip(self._ids[order].tolist(), distance[order].tolist(), strict=True))
