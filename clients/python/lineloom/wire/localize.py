"""Where was this scan taken, in a site's map?"""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from lineloom.wire.base import Answer, Covariance, Request
from lineloom.wire.evidence import CheckLimit
from lineloom.wire.match import MatchScan

LocalizeVerdict = Literal["unique", "ambiguous", "unknown"]

MAX_RUN = 200
"""Scans in one question."""


class LocalizeRequest(Request):
    """A short run of one robot's scans, in order; the answer is about the latest."""

    scans: list[MatchScan] = Field(min_length=1, max_length=MAX_RUN)


class LocalizeHypothesis(Answer):
    """Where the scan may have been taken: pose of the laser in the component's `map` frame.

    covariance: of the scan against the map around it. score: how sure, 0 to 1, that it is right.
    limits: by check, what its figure is held to.
    """

    component: str
    x: float
    y: float
    theta: float
    covariance: Covariance
    score: float
    checks: dict[str, float | None]
    limits: dict[str, CheckLimit] = Field(default_factory=dict)


class LocalizeAnswer(Answer):
    """Hypotheses, best first, and what may be concluded from them.

    `unique`: the first one is right; `ambiguous`: several fit, or the position along one direction
    is not determined; `unknown`: none fits well enough. scan: which of the scans sent the poses are
    of, from 0: the latest that shows anything; null where none does.
    """

    site: str
    verdict: LocalizeVerdict
    reason: str
    scan: int | None
    hypotheses: list[LocalizeHypothesis]
