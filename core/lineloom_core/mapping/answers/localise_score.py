"""How sure a hypothesis of `localise` is, as a probability.

A logistic model of the checks' figures, fitted on simulated buildings only
(`lineloom_lab.evaluation.localise_calibration`), with queries from the map, from rooms that are
not in it, and from other buildings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

FEATURES = ("evidence", "explained", "conflict", "margin", "places", "information", "isotropy")
WEIGHTS = (1.277, 0.795, -0.537, 1.591, 0.238, -1.317, 1.834)
BIAS = -2.118


def descriptors(checks: Mapping[str, float]) -> NDArray[np.float64]:
    """The model's inputs, in the order of FEATURES, each of order one."""
    return np.array(
        [
            math.log1p(max(checks["evidence"], 0.0)),
            checks["explained"] * 3.0,
            min(checks["conflict_share"], 0.3) * 10.0,
            min(max(checks["margin"], 0.0), 1.0) * 3.0,
            math.log(min(max(checks["places"], 1.0), 20.0)),
            math.log10(max(checks["information"], 1.0)),
            math.log10(max(checks["isotropy"], 1e-3)),
        ]
    )


def probability(checks: Mapping[str, float]) -> float:
    """Probability, 0..1, that a hypothesis with these checks is right."""
    z = BIAS + float(np.dot(WEIGHTS, descriptors(checks)))
    return 1.0 / (1.0 + math.exp(-min(max(z, -30.0), 30.0)))
