"""The calibrated score: how sure that the full pose of the best hypothesis is right.

A logistic model of the checks' figures, fitted on simulated pairs only (`lineloom_core.
evaluation.calibration`, `make calibrate`), so that no real data set has been tuned on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

FEATURES = ("evidence", "conflict", "matched_share", "margin", "information", "overlap", "weak")
WEIGHTS = (2.61, -1.665, -0.078, 0.831, 0.444, -0.628, -0.918)
BIAS = -5.453


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
            1.0 if checks["information"] < 300.0 else 0.0,
        ]
    )


def probability(checks: Mapping[str, float]) -> float:
    """Probability, 0..1, that the best hypothesis is right in full."""
    z = BIAS + float(np.dot(WEIGHTS, descriptors(checks)))
    return 1.0 / (1.0 + math.exp(-min(max(z, -30.0), 30.0)))
