"""Index pairs of two sets of numbers that lie within a window of each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.intp]


def near_pairs(
    a: NDArray[np.float64], b: NDArray[np.float64], window: float, period: float | None = None
) -> tuple[Indices, Indices]:
    """All (i, j) with |a_i - b_j| <= window, by i and then by the size of b_j.

    a: (n,), b: (m,), any unit; `period` makes the difference cyclic (window < period / 2). It
    replaces the loop over all g_x in Algorithms 3 and 4: only relations equal in one parameter
    are compared further.
    """
    index = np.arange(len(b))
    if period is not None:
        a, b = np.mod(a, period), np.mod(b, period)
        b = np.concatenate([b - period, b, b + period])
        index = np.tile(index, 3)
    order = np.argsort(b, kind="stable")
    first = np.searchsorted(b[order], a - window, side="left")
    count = np.searchsorted(b[order], a + window, side="right") - first
    i = np.repeat(np.arange(len(a)), count)
    nth = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
    return i, index[order][np.repeat(first, count) + nth]
