"""The last keyframes of a track: a local map to follow the robot by, and what in it stood still.

A person who walks before the robot looks like a piece of wall that comes along. Between two plain
walls that piece would be all there is to tell the way by, and the robot seem to stand. So a point
counts as steady once another keyframe has measured it where it was, and hardly any has seen through
it. Somebody who walks is measured nowhere twice.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.matching.free_space import seen_by
from lineloom_core.matching.local_map import Cloud, LocalMap

_MOST_MISSES = 0.25  # times as often as a steady point was measured it may have been seen through
_NONE = np.zeros(0, dtype=np.int64)


@storable("recent-keyframe")
@dataclass(eq=False)
class _Kept:
    """A keyframe in the track's frame; by how many others each point was measured, seen through."""

    features: ScanFeatures
    cloud: Cloud
    pose: Pose
    hits: NDArray[np.int64]
    misses: NDArray[np.int64]

    def hold_against(self, other: _Kept) -> None:
        """Count what the other keyframe says of this one's points."""
        measured, through = seen_by(
            other.features, self.cloud.points, other.pose.between(self.pose)
        )
        self.hits += measured
        self.misses += through


@storable("recent", _compared=int, _kept=deque[_Kept], _depth=int)
class Recent:
    """Up to `most` keyframes, the latest `compared` of which are held against each other."""

    def __init__(self, compared: int, most: int) -> None:
        self._compared = compared
        self._kept: deque[_Kept] = deque(maxlen=most)
        self._depth = compared
        self._build()

    def __setstate__(self, state: dict[str, Any]) -> None:
        """The maps are a function of the keyframes: they were left out."""
        self.__dict__.update(state)
        self._build()

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def latest(self) -> tuple[ScanFeatures, Pose]:
        """The latest keyframe and its pose in the track's frame."""
        return self._kept[-1].features, self._kept[-1].pose

    def last(self, most: int) -> list[tuple[ScanFeatures, Pose]]:
        """Up to so many of the latest keyframes and their poses, the latest first."""
        return [(k.features, k.pose) for k in islice(reversed(self._kept), most)]

    def add(self, features: ScanFeatures, cloud: Cloud, pose: Pose, *, depth: int) -> None:
        """Append a keyframe; the local map is of the latest `depth` from now on."""
        none = np.zeros(len(cloud.points), dtype=np.int64)
        new = _Kept(features, cloud, pose, none, none.copy())
        for old in islice(reversed(self._kept), self._compared - 1):
            old.hold_against(new)
            new.hold_against(old)
        self._kept.append(new)
        self._depth = depth
        self._build()

    def _build(self) -> None:
        latest = list(islice(reversed(self._kept), self._depth))
        clouds = [(k.cloud, k.pose) for k in latest]
        self.map = LocalMap.build(clouds)
        """All that was seen."""
        hits = np.concatenate([_NONE, *(k.hits for k in latest)])
        misses = np.concatenate([_NONE, *(k.misses for k in latest)])
        still = (hits > 0) & (misses <= _MOST_MISSES * hits)
        self.steady = LocalMap.build(clouds, kept=still, searchable=False)
        """What stood still."""
