"""A stateless pairwise match."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from lineloom.wire.base import Answer, Covariance, Number, Request, Seq
from lineloom.wire.pose import PoseAnswer
from lineloom.wire.scan import Scan

Verdict = Literal["match", "weak", "ambiguous", "none"]


class MatchScan(Scan):
    """A scan for matching: a single pair needs neither counter nor clock."""

    seq: Seq = 0
    stamp: Number = Field(default=0.0, description="Seconds; not used by the matcher.")


class MatchRequest(Request):
    """Where was `current` taken, seen from `reference`?"""

    reference: MatchScan
    current: MatchScan


class LinePair(Answer):
    """Two line segments taken for the same wall; numbers count from the first ray's side."""

    reference: int
    current: int
    overlap: float
    distance: float
    angle: float


class Alternative(Answer):
    """A runner-up."""

    x: float
    y: float
    theta: float
    score: float


class MatchAnswer(Answer):
    """What is known about T_reference_current.

    `weak`: right up to a slide along weak_direction (rad, in the reference frame). score:
    calibrated, how sure that the full pose is right.
    """

    verdict: Verdict
    T_reference_current: PoseAnswer | None
    weak_direction: float | None
    covariance: Covariance | None
    score: float
    pairs: list[LinePair]
    checks: dict[str, float | None]
    alternatives: list[Alternative]
    reason: str
