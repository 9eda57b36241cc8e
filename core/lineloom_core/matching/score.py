"""The calibrated score: how sure that the full pose of the best hypothesis is right.

A logistic model of the checks' figures, fitted on simulated pairs only (`lineloom_core.
evaluation.calibration`, `make calibrate`), so that no real data set has been tuned on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

FEATURES = ("evidence", "conflict", "matched_share", "margin", "information", "overlap")
WEIGHTS = (4.564, -1.545, -0.438, 0.556, 0.404, -2.282)
BIAS = -6.372


def descriptors(checks: Mapping[str, float]) -> NDArray[np.float64]:
    """The model's inputs, in the order of FEATURES, each of order one."""
    return np.array(
        [
            math.log1p(max(checks["evidence"], 0.0)),
            min(checks["conflict_share"], 0.5) * 10.0,
            checks["matched_share"] * 3.0,
            min(max(checks["margin"], 0.0), 1.0) * 3.0,
            math.log10(max(checks["information"], 1.0)),
            math.log1p(checks["overlap_m"]),
        ]
    )


def probability(checks: Mapping[str, float]) -> float:
    """Probability, 0..1, that the best hypothesis is right in full."""
    z = BIAS + float(np.dot(WEIGHTS, descriptors(checks)))
    return 1.0 / (1.0 + math.exp(-min(max(z, -30.0), 30.0)))
