"""How a baseline words its answer."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from numpy.typing import NDArray


def nothing(reason: str) -> MatchResult:
    """Return the answer of a matcher that has no hypothesis at all."""
    return MatchResult("none", None, None, None, 0.0, reason)


def hypothesis(
    pose: Pose,
    score: float,
    least_score: float,
    *,
    covariance: NDArray[np.float64] | None = None,
    checks: Mapping[str, float] | None = None,
) -> MatchResult:
    """Return the best hypothesis: "match" from `least_score` on, else "none" with `best` set.

    pose: T_reference_current. score: the method's own figure, 0..1; not calibrated. covariance:
    (3, 3) over x, y [m], theta [rad], where the method has one. None of the methods knows weak
    directions or rivals, so none of them ever says "weak" or "ambiguous".
    """
    score = min(max(score, 0.0), 1.0)
    accepted = score >= least_score
    return MatchResult(
        verdict="match" if accepted else "none",
        T_reference_current=pose if accepted else None,
        weak_direction=None,
        covariance=covariance if accepted else None,
        score=score,
        reason="the best of the method's hypotheses"
        if accepted
        else f"the best hypothesis scores {score:.2f}, below {least_score:.2f}",
        checks=dict(checks or {}),
        best=pose,
    )
