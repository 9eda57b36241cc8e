"""Circles and arcs: columns seen from outside, round rooms from inside (the thesis's future work).

Only surfaces that are no lines are tried: small ones that are bent, and chords that turn one way.
A circle must fit as well as the lidar's noise allows, be seen over a good part of a turn, face the
sensor one way, and explain its points far better than a corner, which is two lines, does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import _circle_kernels as _kernels
from lineloom_core.features._circle_kernels import CIRCLE_COLUMNS, COLUMN, ROOM

__all__ = ["CIRCLE_COLUMNS", "COLUMN", "ROOM", "fit_circle"]


def fit_circle(
    points: NDArray[np.float64],
) -> tuple[float, float, float, NDArray[np.float64]] | None:
    """Least-squares circle through points (n, 2) [m]: x, y, radius [m] and their covariance (3, 3).

    Algebraic (least sum of (d^2 - r^2)^2), then geometric (least sum of (d - r)^2, Gauss-Newton).
    The noise is taken from the points' own distances. None where they are straight or too few.
    """
    n = len(points)
    if n < 4:
        return None
    xy = np.ascontiguousarray(points, dtype=np.float64)
    circle, C = np.empty(3), np.empty((3, 3))
    squares = _kernels.geometric_circle(xy, np.arange(n), n, np.inf, circle, np.empty((3, 3)), C)
    if squares < 0.0:
        return None
    x, y, radius = (float(v) for v in circle)
    return x, y, radius, C * (squares / (n - 3))
