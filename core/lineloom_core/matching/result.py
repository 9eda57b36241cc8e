"""The answer of a pairwise match."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose

Verdict = Literal["match", "weak", "ambiguous", "none"]


@dataclass(frozen=True, slots=True)
class LinePair:
    """Two line segments taken for the same wall.

    reference, current: extraction numbers (thesis Table 3.1). overlap: common length [m].
    distance: perpendicular distance after the match [m]. angle: direction difference [rad].
    """

    reference: int
    current: int
    overlap: float
    distance: float
    angle: float


@dataclass(frozen=True, slots=True)
class Alternative:
    """A runner-up hypothesis, apart from the best by more than 0.3 m or 0.15 rad."""

    T_reference_current: Pose
    score: float


@dataclass(frozen=True)
class MatchResult:
    """What is known about T_reference_current, and how well.

    verdict: "match" = right in full; "weak" = right up to a slide along `weak_direction` (rad in
    the reference frame); "ambiguous" = several places fit alike; "none" = no hypothesis stands,
    see `reason`. covariance: 3x3 over x, y, theta in the reference frame [m, rad]: true for right
    answers (see `covariance`), along a weak direction some metres. score in [0, 1]:
    calibrated probability that the full pose of the best hypothesis is right, whatever the
    verdict. checks: each check's figure by name.
    """

    verdict: Verdict
    T_reference_current: Pose | None
    weak_direction: float | None
    covariance: NDArray[np.float64] | None
    score: float
    reason: str
    pairs: tuple[LinePair, ...] = ()
    checks: dict[str, float] = field(default_factory=dict)
    alternatives: tuple[Alternative, ...] = ()
    best: Pose | None = None
    """The best hypothesis, whatever the verdict: what `score` speaks of."""
