"""The rotational difference of two scans (§5.6.1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lineloom_core.geometry import circular_mean
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.pairs import Match


def precision_value(length_i: ArrayLike, length_j: ArrayLike) -> NDArray[np.float64]:
    """Weight of a pair of lines [m^2]: ||l_i|| ||l_j|| (shorter / longer) = shorter squared."""
    precision: NDArray[np.float64] = np.minimum(length_i, length_j) ** 2
    return precision


def rotational_difference(
    matching_pairs: Sequence[Match], L_r: LineSegments, L_c: LineSegments
) -> float:
    """Algorithm 8: the angle that turns S_c onto S_r [rad], theta of T_reference_current.

    Departures: the weighted sum is divided by the sum of the weights, not by the number of pairs,
    and the mean is circular, as 359 and 1 degree do not have the mean 180.
    Raises ValueError where there is no pair.
    """
    if not matching_pairs:
        raise ValueError("no matching line segments, so no rotational difference")
    k, m = np.array(matching_pairs, dtype=np.int64).T
    weights = precision_value(L_r.lengths[k], L_c.lengths[m])
    return circular_mean(L_r.directions[k] - L_c.directions[m], weights)
