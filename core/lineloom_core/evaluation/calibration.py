"""Fitting the matcher's score on simulated pairs: `python -m lineloom_core.evaluation.calibration`.

Logistic regression (Newton's method with a small ridge) of "the full pose is right" on the
matcher's own figures. Prints the constants of `lineloom_core.matching.score`, and how well the
probabilities hold on worlds that were not fitted.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lineloom_core.evaluation.simulated_pairs import simulated_pairs
from lineloom_core.geometry import angle_difference
from lineloom_core.matching import LineMatcher
from lineloom_core.matching.score import FEATURES, descriptors
from lineloom_core.simulation import scanner_360, sick_lms200, world_named

WORLDS = ("office", "rooms", "corridors")
PEOPLE = 8
RIGHT_WITHIN = (0.3, np.radians(5.0))


def samples(seeds: Iterable[int], pairs_each: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Descriptors (n, k) and whether the best hypothesis was right (n,)."""
    matcher = LineMatcher()
    rows: list[NDArray[np.float64]] = []
    right: list[bool] = []
    for seed in seeds:
        for name in WORLDS:
            for lidar in (sick_lms200(), scanner_360()):
                rng = np.random.default_rng([seed, len(name), lidar.beams])
                world = world_named(name, seed)
                for pair in simulated_pairs(world, lidar, rng, pairs_each, people=PEOPLE):
                    result = matcher.match(pair.reference, pair.current)
                    if not result.checks:
                        continue
                    rows.append(descriptors(result.checks))
                    best = result.best
                    right.append(
                        best is not None
                        and best.distance(pair.T_reference_current) < RIGHT_WITHIN[0]
                        and abs(angle_difference(best.theta, pair.T_reference_current.theta))
                        < RIGHT_WITHIN[1]
                    )
    return np.array(rows), np.array(right)


def fit_logistic(
    x: NDArray[np.float64], y: NDArray[np.bool_], ridge: float = 1.0
) -> tuple[NDArray[np.float64], float]:
    """Weights (k,) and bias of the logistic model, by Newton's method."""
    a = np.column_stack([x, np.ones(len(x))])
    w = np.zeros(a.shape[1])
    for _ in range(50):
        p = 1.0 / (1.0 + np.exp(-np.clip(a @ w, -30, 30)))
        gradient = a.T @ (y - p) - ridge * w
        hessian = (a * (p * (1 - p))[:, None]).T @ a + ridge * np.eye(len(w))
        step = np.linalg.solve(hessian, gradient)
        w = w + step
        if np.abs(step).max() < 1e-9:
            break
    return w[:-1], float(w[-1])


def main() -> None:
    """Fit on some seeds, report on others."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=150, help="pairs per world, seed and lidar")
    pairs = parser.parse_args().pairs
    x, y = samples(range(100, 106), pairs)
    weights, bias = fit_logistic(x, y)
    print("FEATURES =", FEATURES)
    print("WEIGHTS =", tuple(round(float(w), 3) for w in weights))
    print("BIAS =", round(bias, 3))
    x, y = samples(range(200, 203), pairs)
    p = 1.0 / (1.0 + np.exp(-(x @ weights + bias)))
    print(f"{len(y)} pairs of other worlds, {100 * y.mean():.1f} % right")
    for low in np.arange(0.0, 1.0, 0.1):
        inside = (p >= low) & (p < low + 0.1)
        if inside.any():
            print(f"  said {p[inside].mean():.2f}  was {y[inside].mean():.2f}  n {inside.sum()}")


if __name__ == "__main__":
    main()
