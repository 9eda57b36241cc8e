"""The score of an answer: how probable it is that its full pose is right."""

from __future__ import annotations

import math

WEIGHT_TOTAL, WEIGHT_EDGES, BIAS = 1.28, 2.17, -4.87


def agreement_score(total: float, edges: int) -> float:
    """Probability in [0, 1] that the full pose is right, from what the matching table agreed on.

    total: sum of the merged scores of the pairs left in the end (Table 5.2), edges: number of
    common edges that the translation is the mean of. A departure, as the thesis gives its answers
    no score: a logistic model, fitted on simulated pairs only
    (`tests/core/matching_thesis/fit_score.py`).
    """
    z = BIAS + WEIGHT_TOTAL * math.log(max(total, 1e-9)) + WEIGHT_EDGES * math.log1p(edges)
    return 1.0 / (1.0 + math.exp(-min(max(z, -30.0), 30.0)))
