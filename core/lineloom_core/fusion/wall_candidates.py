"""Which lines that keyframes saw may be one wall.

First those that lie on each other within their own uncertainty (`merge`); then those that overlap
within that of poses: two surfaces of one side cannot stand closely behind each other, for nobody
would see the rear one. How far poses are off is taken from how far observations of a wall usually
lie apart. At last, what goes on in one line is one wall, openings or not.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.fusion import _kernels as merging
from lineloom_core.fusion import _wall_kernels as kernels
from lineloom_core.fusion.merge import FusionConfig, merge_observations, oldest
from lineloom_core.fusion.segment_map import LineObservations

MOST_GATE_M = 0.25
_LEAST_GATE_M = 0.06
_TWIN_ANGLE, _TWIN_OFFSET_M, _TWIN_OVERLAP_M = math.radians(8.0), 0.2, 0.2
_TWIN_SPREADS = 18.0
_MUCH_OBSERVED = 5
_CHAIN_ANGLE, _CHAIN_OFFSET_M, _CHAIN_GAP_M, _CHAIN_SPREAD_M = math.radians(3.0), 0.03, 1.3, 0.03
_PASSES = 2


def candidates(
    observations: LineObservations, config: FusionConfig
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return walls (m, WALL_COLUMNS, see `_wall_kernels`), and that of each observation (n,).

    Observations without length are on none, -1.
    """
    labels, lines = merge_observations(observations, config)
    solid = labels >= 0
    inner = labels[solid]
    names = oldest(inner, observations.id[solid], len(lines))
    apart = _usually_apart(lines, np.bincount(inner, minlength=len(lines)))
    twin = min(max(_TWIN_SPREADS * apart, config.max_offset), _TWIN_OFFSET_M)
    for angle, offset, gap, spread in (
        (_TWIN_ANGLE, twin, -_TWIN_OVERLAP_M, 0.5 * twin),
        (_CHAIN_ANGLE, _CHAIN_OFFSET_M, _CHAIN_GAP_M, _CHAIN_SPREAD_M),
    ):
        for _ in range(_PASSES):
            before = len(lines)
            order = np.lexsort((names, -_lengths(lines)))
            step, lines = merging.merge_pass(lines, order, math.cos(angle), offset, gap, spread)
            names, inner = oldest(step, names, len(lines)), step[inner]
            if len(lines) == before:
                break
    of = np.full(len(observations), -1, dtype=np.int64)
    of[solid] = inner
    return _as_walls(lines), of


def _usually_apart(lines: NDArray[np.float64], observed: NDArray[np.int64]) -> float:
    """Return how far observations of one wall lie apart [m]: noise and the poses' errors."""
    much = np.flatnonzero((observed >= _MUCH_OBSERVED) & (_lengths(lines) >= 1.0))
    if not len(much):
        return 0.0
    spread, weight = _spreads(lines[much]), _lengths(lines[much])
    order = np.argsort(spread, kind="stable")
    middle = np.searchsorted(np.cumsum(weight[order]), 0.5 * weight.sum())
    return float(spread[order][min(middle, len(order) - 1)])


def _spreads(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    sxx, sxy, syy = (lines[:, c] for c in (merging.SXX, merging.SXY, merging.SYY))
    least = 0.5 * (sxx + syy) - np.hypot(0.5 * (sxx - syy), sxy)
    found: NDArray[np.float64] = np.sqrt(np.maximum(least, 0.0) / lines[:, merging.W])
    return found


def _lengths(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    found: NDArray[np.float64] = np.hypot(
        lines[:, merging.X2] - lines[:, merging.X1], lines[:, merging.Y2] - lines[:, merging.Y1]
    )
    return found


def _as_walls(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    walls = np.empty((len(lines), kernels.WALL_COLUMNS))
    length = _lengths(lines)
    u = (lines[:, merging.X2 : merging.Y2 + 1] - lines[:, merging.X1 : merging.Y1 + 1]) / length[
        :, None
    ]
    centre = lines[:, merging.CX : merging.CY + 1]
    walls[:, kernels.CX : kernels.CY + 1] = centre
    walls[:, kernels.UX : kernels.UY + 1] = u
    walls[:, kernels.LOW] = ((lines[:, merging.X1 : merging.Y1 + 1] - centre) * u).sum(axis=1)
    walls[:, kernels.HIGH] = walls[:, kernels.LOW] + length
    walls[:, kernels.GATE] = np.clip(0.03 + 3.0 * _spreads(lines), _LEAST_GATE_M, MOST_GATE_M)
    walls[:, kernels.STRENGTH] = lines[:, merging.W] * length
    return walls
