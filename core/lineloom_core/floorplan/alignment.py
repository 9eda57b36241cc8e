"""Which way a building's walls run, and the frame in which they run along the axes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose

_QUARTER = 0.5 * math.pi
_INLIER_RAD = math.radians(4.0)
_BINS = 180
_LEAST_SHARE = 0.3
"""Share of the wall length that must run within 4 degrees of the two directions."""
_ROUNDS = 5


def dominant_direction(lines: NDArray[np.float64]) -> float | None:
    """Return the angle in (-45, 45] degrees [rad] that most wall runs along, or across.

    lines: (n, 4) x1, y1, x2, y2 [m]. Weighted by length, circular over a quarter turn: the peak of
    a histogram, then the circular mean of what lies near it. None where no direction stands out,
    as in a round building, or where there are no lines.
    """
    dx, dy = lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]
    weight = np.hypot(dx, dy)
    if weight.sum() <= 0.0:
        return None
    angle = np.arctan2(dy, dx) % _QUARTER
    direction = _peak(angle, weight)
    for _ in range(_ROUNDS):
        off = _off(angle, direction)
        near = np.abs(off) <= _INLIER_RAD
        if weight[near].sum() < _LEAST_SHARE * weight.sum():
            return None
        direction += float(np.average(off[near], weights=weight[near]))
    return _centred(direction)


def aligning(lines: NDArray[np.float64]) -> Pose:
    """Return T_aligned_map: the smallest turn about the origin that lays walls along the axes.

    The identity where no direction stands out.
    """
    direction = dominant_direction(lines)
    return Pose.identity() if direction is None else Pose(0.0, 0.0, -direction)


def _peak(angle: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    """Return the centre of the heaviest bin, each smoothed with its two neighbours."""
    bins = np.minimum((angle / _QUARTER * _BINS).astype(np.int64), _BINS - 1)
    heights = np.bincount(bins, weight, _BINS)
    smooth = heights + 0.5 * (np.roll(heights, 1) + np.roll(heights, -1))
    return (int(smooth.argmax()) + 0.5) * _QUARTER / _BINS


def _off(angle: NDArray[np.float64], direction: float) -> NDArray[np.float64]:
    off: NDArray[np.float64] = (angle - direction + 0.5 * _QUARTER) % _QUARTER - 0.5 * _QUARTER
    return off


def _centred(direction: float) -> float:
    centred = (direction + 0.5 * _QUARTER) % _QUARTER - 0.5 * _QUARTER
    return 0.5 * _QUARTER if centred == -0.5 * _QUARTER else centred
