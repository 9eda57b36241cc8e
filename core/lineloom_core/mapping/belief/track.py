"""A run of tracking without a break."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.mapping.facts.drift import Chain


@storable("track")
@dataclass
class Track:
    """Keyframes that hang together by themselves, in their order.

    id: the track's number; where a retracted step cut it, the second part's first keyframe is
    added to it, as in "3.57".
    """

    id: str
    robot: str
    keyframes: list[int] = field(default_factory=list)
    kept: list[int] = field(default_factory=list)
    """Those of them that were not let go (`thinning`)."""
    travelled: list[float] = field(default_factory=list)
    """Distance driven up to each keyframe [m]."""
    last_place_at: float = 0.0
    """Distance driven when the last place was made [m]."""
    places: list[int] = field(default_factory=list)
    """Ids of the places made of it, in their order."""
    right_until: int | None = None
    """The last place that agreed with other tracks' maps."""
    wrong_since: int = 0
    """Places in a row that did not."""
    chain: Chain = field(default_factory=Chain)
    """How its error grew."""

    def append(self, keyframe: int, step: Pose, drift: NDArray[np.float64]) -> None:
        """Add the next keyframe: T_previous_this and its covariance."""
        way = math.hypot(step.x, step.y)
        self.travelled.append(self.travelled[-1] + way if self.travelled else 0.0)
        self.keyframes.append(keyframe)
        self.kept.append(keyframe)
        self.chain.append(step, drift)

    def position(self, keyframe: int) -> int:
        """Index of a keyframe in the track, whose ids ascend."""
        return bisect_left(self.keyframes, keyframe)

    def kept_position(self, keyframe: int) -> int:
        """Index of a kept keyframe among those kept."""
        return bisect_left(self.kept, keyframe)

    def between(self, first: int, last: int) -> list[int]:
        """The kept keyframes from one to another, both included."""
        return self.kept[bisect_left(self.kept, first) : bisect_right(self.kept, last)]

    def neighbours(self, keyframe: int, reach: int) -> list[int]:
        """The kept keyframe and up to `reach` before and after it that are kept, itself first."""
        where = self.kept_position(keyframe)
        first = max(where - reach, 0)
        around = range(first, min(where + reach + 1, len(self.kept)))
        return [self.kept[i] for i in sorted(around, key=lambda i: (abs(i - where), i))]

    def let_go(self, run: Sequence[int]) -> tuple[int | None, int | None]:
        """Drop a run of successive kept keyframes; return those before and after it."""
        begin = self.kept_position(run[0])
        end = begin + len(run)
        before = self.kept[begin - 1] if begin else None
        after = self.kept[end] if end < len(self.kept) else None
        del self.kept[begin:end]
        return before, after

    def drift(self, a: int, b: int) -> NDArray[np.float64]:
        """Covariance (3, 3) of T_a_b, two of its keyframes, by tracking alone."""
        return self.chain.between(self.position(a), self.position(b))

    def drift_rates(self) -> tuple[float, float]:
        """Variance added per metre on average, m^2 and rad^2."""
        position, heading = self.chain.spread
        way = max(self.travelled[-1], 1.0)
        return position / way, heading / way
