"""Which of a few candidate edges does the rest of the graph support?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.graph.edge import Edge, chi_squared
from lineloom_core.graph.solver import weighted_step

CHI2_99 = 11.345
"""99 % quantile of chi-squared with 3 degrees of freedom."""

_GROWTH = 2.0  # of mu per round; the paper has 1.4, which costs twice the rounds
_MAX_ROUNDS = 40
_INNER_ITERATIONS = 2
_LEAST_WEIGHT = 1e-6  # keeps a piece that hangs on rejected candidates from floating away
_DECIDED = 1e-3


@dataclass(frozen=True)
class InlierTest:
    """The candidates that survived, and what each of them costs.

    inliers: ids in the order given. chi2: squared whitened error by candidate id where the
    survivors have pulled the graph. poses: the graph there. rounds: of reweighting.
    """

    inliers: tuple[str, ...]
    chi2: dict[str, float]
    poses: dict[int, Pose]
    rounds: int


def select_inliers(
    nodes: Mapping[int, Pose],
    edges: Sequence[Edge],
    candidates: Sequence[Edge],
    anchor: int,
    chi2_max: float = CHI2_99,
) -> InlierTest:
    """Tell the candidates that fit together with the trusted `edges` from those that do not.

    Graduated non-convexity with truncated least squares (Yang, Antonante, Tzoumas and Carlone
    2020, eq. 14): starts as plain least squares over everything and hardens step by step, so it
    does not depend on a good start as a robust kernel does. `edges` are never doubted. All nodes
    must hang together by edges and candidates. Meant for a handful of candidates that passed the
    pairwise test: 20 rounds of two iterations, about a second at 3,000 nodes.
    """
    every = [*edges, *candidates]
    if not candidates:
        return InlierTest((), {}, dict(nodes), 0)
    poses = dict(nodes)
    weights = np.ones(len(candidates))
    mu, rounds = 0.0, 0
    for rounds in range(1, _MAX_ROUNDS + 1):  # noqa: B007
        everyone = [1.0] * len(edges) + [max(float(w), _LEAST_WEIGHT) for w in weights]
        poses = weighted_step(poses, every, everyone, anchor, _INNER_ITERATIONS)
        chi2 = chi_squared(candidates, poses)
        if mu == 0.0:
            mu = _first_mu(float(chi2.max()), chi2_max)
            if mu <= 0.0:  # even the worst is within its noise
                break
        else:
            mu *= _GROWTH
        weights = _truncated_weights(chi2, chi2_max, mu)
        if bool(np.all((weights < _DECIDED) | (weights > 1.0 - _DECIDED))):
            break
    poses = _settle(poses, every, len(edges), weights, anchor)
    chi2 = chi_squared(candidates, poses)
    ids = [e.id for e in candidates]
    kept = tuple(np.array(ids)[(weights > 0.5) & (chi2 <= chi2_max)].tolist())
    return InlierTest(kept, dict(zip(ids, chi2.tolist(), strict=True)), poses, rounds)


def _settle(
    poses: dict[int, Pose],
    every: Sequence[Edge],
    trusted: int,
    weights: NDArray[np.float64],
    anchor: int,
) -> dict[int, Pose]:
    """Let the graph come to rest under the survivors alone."""
    hard = [1.0] * trusted + [1.0 if w > 0.5 else _LEAST_WEIGHT for w in weights]
    return weighted_step(poses, every, hard, anchor, 10 * _INNER_ITERATIONS)


def _first_mu(chi2_worst: float, chi2_max: float) -> float:
    """Return the mu at which the surrogate is convex (remark 5); <= 0: nothing to reject."""
    return chi2_max / (2.0 * chi2_worst - chi2_max) if chi2_worst > chi2_max else 0.0


def _truncated_weights(
    chi2: NDArray[np.float64], chi2_max: float, mu: float
) -> NDArray[np.float64]:
    """Return the weights of eq. 14: 1 for small errors, 0 for large, a slope in between."""
    low, high = mu / (mu + 1.0) * chi2_max, (mu + 1.0) / mu * chi2_max
    slope = np.sqrt(chi2_max * mu * (mu + 1.0) / np.maximum(chi2, 1e-300)) - mu
    weights: NDArray[np.float64] = np.where(chi2 <= low, 1.0, np.where(chi2 >= high, 0.0, slope))
    return weights
