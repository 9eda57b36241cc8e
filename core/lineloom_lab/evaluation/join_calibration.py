"""Fitting how probably a set is false: `python -m lineloom_lab.evaluation.join_calibration`.

A logistic regression with a small ridge on what `lineloom_core.join_odds` makes of the figures,
each weight held to the sign that reason gives it. How far the probabilities hold is shown on each
half of the buildings, of even and of odd seeds, by a model that was fitted on the other half.
Trials of one pair of maps count as one.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from lineloom_core.join_odds import WEIGHTS
from numpy.typing import NDArray

from lineloom_lab.evaluation.join_fleets import join_buildings
from lineloom_lab.evaluation.join_trials import Trial, trials

FITTED = tuple(name for name in WEIGHTS if name != "kin")
Model = tuple[NDArray[np.float64], float]
_RIDGE = 0.3  # on weights of figures that vary by one
_STEPS = 60


def described(found: Sequence[Trial]) -> NDArray[np.float64]:
    """What is made of the figures, shape (n, k), columns as in FITTED."""
    return np.array([[WEIGHTS[name].described(t.figures) for name in FITTED] for t in found])


def counted(found: Sequence[Trial]) -> NDArray[np.float64]:
    """How much each trial counts, shape (n,): those of one pair that are equally right, one."""
    times = Counter((t.kind, t.seed, t.pair, t.false) for t in found)
    return np.array([1.0 / times[t.kind, t.seed, t.pair, t.false] for t in found])


def fit_monotone(x: NDArray[np.float64], y: NDArray[np.bool_], count: NDArray[np.float64]) -> Model:
    """Weights (k,), none negative, for x about its mean, and bias: Newton's method.

    A weight that would be negative is left out, the one that would be most first.
    """
    spread = np.maximum(x.std(axis=0), 1e-9)
    free = np.ones(x.shape[1], dtype=bool)
    while True:
        w, bias = _newton((x / spread)[:, free], y, count)
        if not len(w) or w.min() >= 0.0:
            break
        free[np.flatnonzero(free)[int(np.argmin(w))]] = False
    weights = np.zeros(x.shape[1])
    weights[free] = w
    return weights / spread, bias


def _newton(x: NDArray[np.float64], y: NDArray[np.bool_], count: NDArray[np.float64]) -> Model:
    a = np.column_stack([x, np.ones(len(x))])
    ridge = np.append(np.full(x.shape[1], _RIDGE), 1e-6)
    w = np.zeros(a.shape[1])
    for _ in range(_STEPS):
        p = 1.0 / (1.0 + np.exp(-np.clip(a @ w, -30.0, 30.0)))
        gradient = a.T @ (count * (y - p)) - ridge * w
        hessian = (a * (count * p * (1.0 - p))[:, None]).T @ a + np.diag(ridge)
        step = np.linalg.solve(hessian, gradient)
        w = w + step
        if np.abs(step).max() < 1e-9:
            break
    return w[:-1], float(w[-1])


def probabilities(model: Model, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Probability of being false for each row of x about the mean, shape (n,)."""
    p: NDArray[np.float64] = 1.0 / (1.0 + np.exp(-np.clip(x @ model[0] + model[1], -30.0, 30.0)))
    return p


def reliability(
    p: NDArray[np.float64], false: NDArray[np.bool_], count: NDArray[np.float64]
) -> str:
    """A table: of sets that are said to be false with so much, how many were."""
    edges = (0.0, 0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
    lines = [f"{'said':>18}{'sets':>8}{'mean said':>11}{'were false':>12}"]
    for low, high in pairwise(edges):
        inside = (p >= low) & (p < high + (high == 1.0))
        if weight := float(count[inside].sum()):
            said, was = (float((count * v)[inside].sum()) / weight for v in (p, false))
            lines.append(f"{low:8.2%} – {high:7.2%}{weight:8.0f}{said:11.2%}{was:12.2%}")
    return "\n".join(lines)


def fit_and_report(found: Sequence[Trial]) -> str:
    """The constants of `join_odds`, of all; and how reliable each half is by the other's."""
    x, count = described(found), counted(found)
    false = np.array([t.false for t in found])
    usual = np.average(x, axis=0, weights=count)
    weights, prior = fit_monotone(x - usual, false, count)
    lines = [f"PRIOR = {prior:.3f}"]
    lines += [f"{n}: {w:.3f}, {u:.3f}" for n, w, u in zip(FITTED, weights, usual, strict=True)]
    even = np.array([t.seed % 2 == 0 for t in found])
    p = np.empty(len(found))
    for half in (even, ~even):
        model = fit_monotone((x - usual)[~half], false[~half], count[~half])
        p[half] = probabilities(model, (x - usual)[half])
    loss = float(np.average(-np.log(np.where(false, p, 1.0 - p) + 1e-12), weights=count))
    lines += ["", f"{len(found)} trials of {count.sum():.0f} pairs, said by the other half:"]
    return "\n".join([*lines, reliability(p, false, count), f"log loss {loss:.3f}"])


def collected(seeds: Iterable[int]) -> list[Trial]:
    """The trials of one fleet in each kind of building per seed."""
    return [t for seed in seeds for kind in join_buildings() for t in trials(kind, seed)]


def main() -> None:
    """Fit, and show how reliable that is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=40, help="buildings of each kind")
    print(fit_and_report(collected(range(parser.parse_args().seeds))))


if __name__ == "__main__":
    main()
