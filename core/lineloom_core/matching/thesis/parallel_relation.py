"""The geometrical relation "parallel line distance" (§4.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.thesis.angle_relation import line_pairs, relative_angle
from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.consistency import ConsistencyTables
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.near_pairs import Indices, near_pairs

OVERLAP, MAY_OVERLAP, NO_OVERLAP = 0, 1, 2


@dataclass(frozen=True, eq=False)
class ParallelRelations:
    """n relations P(k, m, beta, o, d^h, d^v) of line segments parallel within the error window.

    lines: (n, 2) k, m. beta: (n,) [rad], about 0 or about pi (facing each other: a corridor).
    o: (n,) OVERLAP, MAY_OVERLAP or NO_OVERLAP. d_h: (n,) [m] the overlap's length or the gap along
    the lines, undefined (seen gap) where they may overlap. exact: (n,) is d_h bounded by edge
    points alone, so that it is a property of the walls and not of the view? d_v: (n,) [m] distance
    across.
    """

    lines: NDArray[np.int64]
    beta: NDArray[np.float64]
    o: NDArray[np.int64]
    d_h: NDArray[np.float64]
    exact: NDArray[np.bool_]
    d_v: NDArray[np.float64]

    @staticmethod
    def of(L: LineSegments, both_orders: bool, windows: Windows) -> ParallelRelations:
        """Extract one relation per pair of parallel line segments."""
        return ParallelRelations.between(L, *line_pairs(len(L), both_orders), windows)

    @staticmethod
    def between(
        L: LineSegments, k: NDArray[np.int64], m: NDArray[np.int64], windows: Windows
    ) -> ParallelRelations:
        """Extract one relation per pair (k, m) that is parallel; k, m: (q,) extraction numbers."""
        beta = relative_angle(L.directions[k], L.directions[m])
        tilt = 0.5 * wrap_array(2.0 * beta)  # how far from parallel, whichever way they run
        parallel = np.abs(tilt) <= windows.angle
        k, m, beta, tilt = k[parallel], m[parallel], beta[parallel], tilt[parallel]
        axis = L.directions[k] + 0.5 * tilt
        on_k, on_m = _Stretch.of(L, k, axis, -0.5 * tilt), _Stretch.of(L, m, axis, 0.5 * tilt)
        low, high = np.maximum(on_k.low, on_m.low), np.minimum(on_k.high, on_m.high)
        gap, middle = low - high, 0.5 * (low + high)
        d_v = np.abs(on_m.across(middle) - on_k.across(middle))
        k_bounds = (on_k.low >= on_m.low, on_k.high <= on_m.high)
        exact = _bounds_are_edges(L, k, m, np.cos(beta) < 0.0, k_bounds)
        o = np.where(gap < 0.0, OVERLAP, np.where(exact, NO_OVERLAP, MAY_OVERLAP))
        return ParallelRelations(np.column_stack([k, m]), beta, o, np.abs(gap), exact, d_v)

    def __len__(self) -> int:
        return len(self.beta)

    def compatible(
        self, x: ParallelRelations, tables: ConsistencyTables, windows: Windows
    ) -> tuple[Indices, Indices]:
        """Index pairs (g_c, g_x) whose angle, distances and overlap agree."""
        i, j = near_pairs(self.d_v, x.d_v, windows.distance)
        same_side = np.abs(wrap_array(self.beta[i] - x.beta[j])) <= 2.0 * windows.angle
        keep = same_side & overlaps_agree(self, i, x, j, windows.distance)
        return i[keep], j[keep]


def overlaps_agree(
    c: ParallelRelations, i: Indices, x: ParallelRelations, j: Indices, window: float
) -> NDArray[np.bool_]:
    """Can o and d^h of relations c_i and x_j be those of the same walls? i, j and answer: (q,).

    Departure: the text wants equal o and d^h. Where an interior point bounds them, the walls go on
    unseen: an overlap seen is then the least there is, a gap seen the greatest, and lines that may
    overlap are like any. Written as signed gaps (overlap negative), a seen gap is exact or an
    upper bound.
    """
    gap_c = np.where(c.o == OVERLAP, -c.d_h, c.d_h)[i]
    gap_x = np.where(x.o == OVERLAP, -x.d_h, x.d_h)[j]
    exact_c, exact_x = c.exact[i], x.exact[j]
    c_not_too_wide = ~exact_c | (gap_c <= gap_x + window)
    x_not_too_wide = ~exact_x | (gap_x <= gap_c + window)
    agree: NDArray[np.bool_] = c_not_too_wide & x_not_too_wide
    return agree


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Lines seen along an axis each, (n,): from `low` to `high` [m], and how far across."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    middle_across: NDArray[np.float64]
    slope: NDArray[np.float64]

    @staticmethod
    def of(
        L: LineSegments,
        k: NDArray[np.int64],
        axis: NDArray[np.float64],
        tilt: NDArray[np.float64],
    ) -> _Stretch:
        """Project lines k on axes [rad] from which they are tilted by `tilt` [rad]."""
        c, s = np.cos(axis), np.sin(axis)
        a = c * L.s[k, 0] + s * L.s[k, 1]
        b = c * L.e[k, 0] + s * L.e[k, 1]
        middle = 0.5 * (L.s[k] + L.e[k])
        across = c * middle[:, 1] - s * middle[:, 0]
        return _Stretch(np.minimum(a, b), np.maximum(a, b), across, np.tan(tilt))

    def across(self, at: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where the infinite lines lie across the axis at `at` along it, (n,) [m]."""
        across: NDArray[np.float64] = self.middle_across + self.slope * (
            at - 0.5 * (self.low + self.high)
        )
        return across


def _bounds_are_edges(
    L: LineSegments,
    k: NDArray[np.int64],
    m: NDArray[np.int64],
    runs_back: NDArray[np.bool_],
    k_bounds: tuple[NDArray[np.bool_], NDArray[np.bool_]],
) -> NDArray[np.bool_]:
    """Are both ends that bound an overlap or a gap edge points? (n,)

    runs_back: does l_m run against l_k, so that its end lies low? k_bounds: is the low, the high
    bound an end of l_k (else of l_m)?
    """
    low_m = np.where(runs_back, L.e_is_edge[m], L.s_is_edge[m])
    high_m = np.where(runs_back, L.s_is_edge[m], L.e_is_edge[m])
    low_is_edge = np.where(k_bounds[0], L.s_is_edge[k], low_m)
    high_is_edge = np.where(k_bounds[1], L.e_is_edge[k], high_m)
    both: NDArray[np.bool_] = low_is_edge & high_is_edge
    return both
