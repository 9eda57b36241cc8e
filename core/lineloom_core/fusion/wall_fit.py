"""The line that keyframes agree on: how far they lie apart in fact counts, not their promises."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.fusion import _wall_kernels as kernels

_ROUNDS = 4
_HUBER = 1.5
_VISIT_GAP = 3
_LEAST_SPREAD = 0.002**2
_LEAST_REACH_M, _MOST_REACH_M = 0.04, 0.25


@dataclass(frozen=True, eq=False)
class Fit:
    """Per wall the line d = line[:, 0] + line[:, 1] t, (m, 2), and its covariance (m, 2, 2).

    reach (m,): how far from the line points of it may lie [m].
    """

    line: NDArray[np.float64]
    covariance: NDArray[np.float64]
    reach: NDArray[np.float64]


def fitted(rows: NDArray[np.float64], m: int) -> Fit:
    """Fit m walls by weighted least squares over what keyframes say, robust against single ones.

    rows: as `_wall_kernels.said_by_keyframe` returns them.

    A keyframe's points on a wall share its pose's error: their mean counts with the variance
    spread^2 + noise^2 / n, the spread between keyframes being measured on the wall itself.
    """
    wall = rows[:, kernels.ROW_WALL].astype(np.int64)
    n, t, d = (rows[:, c] for c in (kernels.ROW_COUNT, kernels.ROW_T, kernels.ROW_D))
    tt, td, dd = (rows[:, c] for c in (kernels.ROW_TT, kernels.ROW_TD, kernels.ROW_DD))
    inner = np.maximum(dd - np.where(tt > 0, td**2 / np.maximum(tt, 1e-12), 0.0), 0.0)
    freedom = np.maximum(n - 2.0, 0.0)
    pooled = max(float(inner.sum() / max(freedom.sum(), 1.0)), 1e-6)
    noise = (_sums(inner, wall, m) + 10.0 * pooled) / (_sums(freedom, wall, m) + 10.0)
    weight, spread, common = np.ones(len(rows)), np.full(m, 0.02**2), _LEAST_SPREAD
    line, covariance = np.zeros((m, 2)), np.zeros((m, 2, 2))
    for _ in range(_ROUNDS):
        w = weight / (n * spread[wall] + noise[wall])  # of one point
        s0, s1 = _sums(w * n, wall, m), _sums(w * n * t, wall, m)
        s2 = _sums(w * (n * t * t + tt), wall, m)
        r0, r1 = _sums(w * n * d, wall, m), _sums(w * (n * t * d + td), wall, m)
        det = np.maximum(s0 * s2 - s1 * s1, 1e-12)
        line = np.column_stack([(s2 * r0 - s1 * r1) / det, (s0 * r1 - s1 * r0) / det])
        covariance = np.array([[s2, -s1], [-s1, s0]]).transpose(2, 0, 1) / det[:, None, None]
        residual = d - line[wall, 0] - line[wall, 1] * t
        variance = noise[wall] / n
        excess = weight * (residual**2 - variance)
        total = float(np.sum(excess)) / max(float(np.sum(weight)), 1.0)
        common = max(total, _LEAST_SPREAD)
        spread = np.maximum(
            (_sums(excess, wall, m) + 3.0 * common) / (_sums(weight, wall, m) + 3.0), _LEAST_SPREAD
        )
        away = np.abs(residual) / np.sqrt(spread[wall] + variance)
        weight = np.minimum(1.0, _HUBER / np.maximum(away, 1e-9))
    # Keyframes that follow each other err alike: what counts as independent is each visit.
    order = np.lexsort((rows[:, kernels.ROW_FRAME], wall))
    frame = rows[order, kernels.ROW_FRAME]
    new = np.ones(len(rows), dtype=np.bool_)
    new[1:] = (np.diff(wall[order]) != 0) | (np.diff(frame) > _VISIT_GAP)
    visits = np.bincount(wall[order], weights=new, minlength=m)
    count = np.bincount(wall, minlength=m)
    visits = np.maximum(visits, 1.0)
    covariance *= (count / visits)[:, None, None]
    # What the poses of one visit are off by does not show within it.
    covariance[:, 0, 0] += common / visits
    reach = np.clip(3.0 * np.sqrt(spread + noise), _LEAST_REACH_M, _MOST_REACH_M)
    return Fit(line, covariance, reach)


def _sums(values: NDArray[np.float64], of: NDArray[np.int64], m: int) -> NDArray[np.float64]:
    sums: NDArray[np.float64] = np.bincount(of, weights=values, minlength=m).astype(np.float64)
    return sums
