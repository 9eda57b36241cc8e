"""Fit the constants of `matching.thesis.score` on simulated pairs: run this file."""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.matching.thesis import ThesisMatcher
from lineloom_lab.evaluation.calibration import fit_logistic
from lineloom_lab.evaluation.pose_error import pose_error
from lineloom_lab.evaluation.simulated_pairs import SimulatedPair, simulated_pairs
from lineloom_lab.simulation import sick_lms200, world_named


def descriptors(matcher: ThesisMatcher, pair: SimulatedPair) -> tuple[list[float], bool] | None:
    """Descriptors of the best hypothesis and whether it is right; None where there is none."""
    result = matcher.match(pair.reference, pair.current)
    if result.best is None:
        return None
    error = pose_error(result.best, pair.T_reference_current)
    near = error.translation < 0.3 and error.rotation < math.radians(5.0)
    return [math.log(result.checks["total"]), math.log1p(result.checks["edges"])], near


def main() -> None:
    """Print the constants."""
    matcher = ThesisMatcher()
    rows = []
    for seed in range(300, 306):
        for name in ("office", "rooms", "corridors"):
            rng = np.random.default_rng([seed, len(name)])
            world = world_named(name, seed)
            pairs = simulated_pairs(world, sick_lms200(), rng, 100, people=6)
            rows += [descriptors(matcher, pair) for pair in pairs]
    x = np.array([r[0] for r in rows if r is not None])
    y = np.array([r[1] for r in rows if r is not None])
    weights, bias = fit_logistic(x, y)
    print("WEIGHT_TOTAL, WEIGHT_EDGES, BIAS =", *weights.round(2), round(bias, 2))


if __name__ == "__main__":
    main()
