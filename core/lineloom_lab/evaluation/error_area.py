"""Error area and error area percentage: accuracy of a match without true poses (§6.3)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap
from numpy.typing import ArrayLike, NDArray

_LEAST_ANGLE_RAD = 1e-12


@dataclass(frozen=True, slots=True)
class ErrorArea:
    """Areas over the bearings at which both lines of a pair are seen [m^2].

    error: what one scan calls traversable and the other does not. common: what both call
    traversable. pairs: number of pairs that share a bearing; the others add nothing.
    """

    error: float
    common: float
    pairs: int

    @property
    def percentage(self) -> float:
        """100 error / (error + common), 0..100; NaN where no pair shares a bearing (§6.3)."""
        total = self.error + self.common
        return 100.0 * self.error / total if total > 0.0 else math.nan


def error_area(
    reference: ArrayLike,
    current: ArrayLike,
    pairs: Sequence[tuple[int, int]],
    T_reference_current: Pose,
) -> ErrorArea:
    """Sum the areas between matching line segments as seen from the current pose (§6.3, Fig. 6.6).

    reference: (n, 4) rows x1, y1, x2, y2 [m] in the frame of S_r. current: (m, 4) in the frame of
    S_c. pairs: (k, m) rows of `reference` and `current`. The viewpoint is the current pose, "with
    respect to the current robot pose". Everything in front of a line is traversable and
    everything behind it is not, so over the bearings where both lines of a pair are seen, the area
    between them is error and that before the nearer one is common; where they cross, the parts on
    either side add up (A_1 to A_4). Exact, by triangles. The text leaves open what happens at
    bearings where only one of the two is seen: no area lies between them there.
    Raises ValueError for a wrong shape or a pair that names no line.
    """
    r = _segments(reference, "reference")
    c = _segments(current, "current")
    seen_r = T_reference_current.inverse().transform(r.reshape(-1, 2)).reshape(-1, 4)
    error, common, count = [], [], 0
    for k, m in pairs:
        if not (0 <= k < len(r) and 0 <= m < len(c)):
            raise ValueError(f"pair ({k}, {m}) names no line")
        between, before = areas_of_pair(seen_r[k], c[m])
        count += before > 0.0
        error.append(between)
        common.append(before)
    return ErrorArea(math.fsum(error), math.fsum(common), count)


def areas_of_pair(p: NDArray[np.float64], q: NDArray[np.float64]) -> tuple[float, float]:
    """Area between two line segments and area before the nearer, seen from the origin [m^2].

    p, q: (4,) x1, y1, x2, y2 [m]. Both over the bearings that they share; (0, 0) where there is
    none, or where one is seen edge-on.
    """
    shared = _shared_bearings(p, q)
    if shared is None:
        return 0.0, 0.0
    start, span = shared
    cuts = [0.0, span]
    crossing = _crossing_bearing(p, q)
    if crossing is not None and 0.0 < (at := (crossing - start) % math.tau) < span:
        cuts = [0.0, at, span]
    between, before = 0.0, 0.0
    for low, high in itertools.pairwise(cuts):
        area_p = _triangle(p, start + low, start + high)
        area_q = _triangle(q, start + low, start + high)
        between += abs(area_p - area_q)
        before += min(area_p, area_q)
    return between, before


def _segments(rows: ArrayLike, what: str) -> NDArray[np.float64]:
    array = np.asarray(rows, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 4:
        raise ValueError(f"{what} must have shape (n, 4), not {array.shape}")
    return array


def _shared_bearings(p: NDArray[np.float64], q: NDArray[np.float64]) -> tuple[float, float] | None:
    """First bearing [rad] and width [rad] of the sector in which both are seen; None if empty."""
    (start_p, span_p), (start_q, span_q) = _sector(p), _sector(q)
    if min(span_p, span_q) <= _LEAST_ANGLE_RAD:
        return None
    ahead = wrap(start_q - start_p)  # sectors are less than half a turn: no second overlap
    first, last = max(ahead, 0.0), min(ahead + span_q, span_p)
    if last - first <= _LEAST_ANGLE_RAD:
        return None
    return start_p + first, last - first


def _sector(p: NDArray[np.float64]) -> tuple[float, float]:
    """Lower bearing and width of the sector that a line segment fills, width in [0, pi)."""
    a, b = math.atan2(p[1], p[0]), math.atan2(p[3], p[2])
    span = wrap(b - a)
    if abs(span) >= math.pi - _LEAST_ANGLE_RAD:
        return a, 0.0  # it runs through the viewpoint: nothing lies before it
    return (a, span) if span >= 0.0 else (b, -span)


def _triangle(p: NDArray[np.float64], low: float, high: float) -> float:
    """Area [m^2] between the origin and the line, from bearing `low` to `high` [rad]."""
    a, b = _range_at(p, low), _range_at(p, high)
    return 0.5 * a * b * math.sin(high - low)


def _range_at(p: NDArray[np.float64], bearing: float) -> float:
    """Distance [m] from the origin to the infinite line along a bearing that meets it."""
    dx, dy = p[2] - p[0], p[3] - p[1]
    return float((p[0] * dy - p[1] * dx) / (math.cos(bearing) * dy - math.sin(bearing) * dx))


def _crossing_bearing(p: NDArray[np.float64], q: NDArray[np.float64]) -> float | None:
    """Bearing [rad] of the infinite lines' intersection; None where they are parallel."""
    ux, uy, vx, vy = p[2] - p[0], p[3] - p[1], q[2] - q[0], q[3] - q[1]
    cross = ux * vy - uy * vx
    if abs(cross) <= 1e-12 * math.hypot(ux, uy) * math.hypot(vx, vy):
        return None
    t = ((q[0] - p[0]) * vy - (q[1] - p[1]) * vx) / cross
    return math.atan2(p[1] + t * uy, p[0] + t * ux)
