"""The calibrated score: how sure that the full pose of the best hypothesis is right.

Two questions, two logistic models of the checks' figures: are its rotation and its position across
the walls right (`family`: the hypothesis and all its slides along them), and if so, is it the right
one of these slides? The score is the product. Both are fitted on simulated pairs only
(`python -m lineloom_lab.evaluation.calibration`), so that no real data set has been tuned on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

FAMILY_FEATURES = (
    "evidence", "conflict", "conflict_m", "matched_share", "seen_share", "lead", "rival", "facing",
    "walls", "loose", "turn",
)  # fmt: skip
FAMILY_WEIGHTS = (
    -0.277,
    -0.385,
    -2.179,
    -0.056,
    0.318,
    1.136,
    -0.133,
    -0.263,
    3.822,
    1.416,
    -0.101,
)
FAMILY_BIAS = -4.219
SLIDE_FEATURES = ("margin", "lead", "weaker", "loose")
SLIDE_WEIGHTS = (-0.146, 2.455, 2.233, 0.139)
SLIDE_BIAS = -1.318


@dataclass(frozen=True, slots=True)
class Belief:
    """Probabilities 0..1. family: right but for a slide. slide: the right slide, if that."""

    family: float
    slide: float

    @property
    def full(self) -> float:
        """Probability that the whole pose is right."""
        return self.family * self.slide


def family_descriptors(checks: Mapping[str, float]) -> list[float]:
    """The first model's inputs, in the order of FAMILY_FEATURES, each of order one."""
    evidence, rival = max(checks["evidence"], 0.0), checks["rival_evidence"]
    return [
        math.log1p(evidence),
        min(checks["conflict_share"], 0.5) * 10.0,
        math.log1p(checks["conflict_m"]),
        checks["matched_share"] * 3.0,
        checks["seen_share"] * 3.0,
        math.log1p(max(evidence - rival, 0.0)),
        math.log1p(rival),
        math.log1p(checks["facing_m"]),
        math.log1p(checks["walls"]),
        _loose(checks),
        math.log10(max(checks["turn_information"], 1.0)),
    ]


def slide_descriptors(checks: Mapping[str, float]) -> list[float]:
    """The second model's inputs, in the order of SLIDE_FEATURES, each of order one."""
    evidence = max(checks["evidence"], 0.0)
    return [
        min(max(checks["slide_margin"], 0.0), 1.0) * 3.0,
        math.log1p(max(evidence - checks["slide_evidence"], 0.0)),
        math.log1p(checks["weaker_m"]),
        _loose(checks),
    ]


def believe(checks: Mapping[str, float]) -> Belief:
    """Probabilities of what the checks speak of."""
    return Belief(
        _logistic(FAMILY_WEIGHTS, FAMILY_BIAS, family_descriptors(checks)),
        _logistic(SLIDE_WEIGHTS, SLIDE_BIAS, slide_descriptors(checks)),
    )


def _loose(checks: Mapping[str, float]) -> float:
    """Of what is matched, what no pair of lines accounts for: the small things that stand about."""
    on_lines = 2.0 * (checks["weaker_m"] + checks["stronger_m"])
    return math.log1p(max(checks["matched_m"] - on_lines, 0.0))


def _logistic(weights: Sequence[float], bias: float, inputs: Sequence[float]) -> float:
    z = bias + sum(w * x for w, x in zip(weights, inputs, strict=True))
    return 1.0 / (1.0 + math.exp(-min(max(z, -30.0), 30.0)))
