"""The inner loop of fusion. Documented twin in the tests: test_fusion.slow_merge_pass."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.kernels import kernel

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Columns of a piece: weight, weighted centroid, central second moments, end points on its line.
W, CX, CY, SXX, SXY, SYY, X1, Y1, X2, Y2 = range(10)
COLUMNS = 10

_CELL_M = 1.0
_SPACING_M = 0.5  # of the samples along a segment, when entered and when looked up
_DRIFT_M = 0.1  # either end of a line may have moved this far since it was entered


@kernel
def merge_pass(
    pieces: Array,
    order: Indices,
    cos_max_angle: float,
    max_offset: float,
    max_gap: float,
    max_spread: float,
) -> tuple[Indices, Array]:
    """Merge pieces one after the other into the growing line that each fits best.

    pieces: (n, 10). order: (n,) in which they are taken. Returns labels (n,) and lines (m, 10).

    Lines are found through a hash of the cells that samples along them lie in. Two segments near
    enough to merge have samples within `reach` of each other, so none is missed.
    """
    n = pieces.shape[0]
    labels = np.full(n, -1, np.int64)
    lines = np.empty((n, COLUMNS))
    entered = np.empty((n, 4))  # the line's ends when it was last put into the hash
    count = 0
    buckets = 1024
    while buckets < 2 * n:
        buckets *= 2
    head = np.full(buckets, -1, np.int64)
    link = np.empty(8 * n + 64, np.int64)
    entry = np.empty(8 * n + 64, np.int64)
    used = 0
    looked_at = np.full(n, -1, np.int64)
    trial = np.empty(COLUMNS)
    reach = math.hypot(1.2 * max_offset, max_gap) + _SPACING_M + _DRIFT_M
    for turn in range(n):
        p = pieces[order[turn]]
        best, best_cost = -1, np.inf
        length = math.hypot(p[X2] - p[X1], p[Y2] - p[Y1])
        steps = math.ceil(length / _SPACING_M)
        for k in range(steps + 1):
            t = k / steps if steps > 0 else 0.0
            x, y = p[X1] + t * (p[X2] - p[X1]), p[Y1] + t * (p[Y2] - p[Y1])
            first_x, last_x = math.floor((x - reach) / _CELL_M), math.floor((x + reach) / _CELL_M)
            first_y, last_y = math.floor((y - reach) / _CELL_M), math.floor((y + reach) / _CELL_M)
            for ix in range(first_x, last_x + 1):
                for iy in range(first_y, last_y + 1):
                    at = head[_bucket(ix, iy, buckets)]
                    while at >= 0:
                        line = entry[at]
                        at = link[at]
                        if looked_at[line] == turn:
                            continue
                        looked_at[line] = turn
                        cost = _fit_cost(lines[line], p, cos_max_angle, max_offset, max_gap)
                        # The lower number wins a tie: the result must not hang on the hash.
                        if cost < best_cost or (cost == best_cost and line < best):
                            _merged(lines[line], p, trial)
                            if _spread(trial) <= max_spread:
                                best, best_cost = line, cost
        if best < 0:
            best = count
            count += 1
            lines[best] = p
            entered[best] = np.inf
        else:
            _merged(lines[best], p, trial)
            lines[best] = trial
        labels[order[turn]] = best
        ends = lines[best, X1 : Y2 + 1]
        if (
            math.hypot(ends[0] - entered[best, 0], ends[1] - entered[best, 1]) <= _DRIFT_M
            and math.hypot(ends[2] - entered[best, 2], ends[3] - entered[best, 3]) <= _DRIFT_M
        ):
            continue
        entered[best] = ends
        steps = math.ceil(math.hypot(ends[2] - ends[0], ends[3] - ends[1]) / _SPACING_M)
        if used + steps + 1 > link.shape[0]:
            link = _grown(link, used + steps + 1)
            entry = _grown(entry, used + steps + 1)
        last = -1
        for k in range(steps + 1):
            t = k / steps if steps > 0 else 0.0
            x, y = ends[0] + t * (ends[2] - ends[0]), ends[1] + t * (ends[3] - ends[1])
            b = _bucket(math.floor(x / _CELL_M), math.floor(y / _CELL_M), buckets)
            if b != last:
                entry[used] = best
                link[used] = head[b]
                head[b] = used
                used += 1
                last = b
    return labels, lines[:count].copy()


@kernel
def _bucket(ix: int, iy: int, buckets: int) -> int:
    """Return the hash bucket of a cell; two cells in one bucket only cost time."""
    return ((ix * 73856093) ^ (iy * 19349663)) & (buckets - 1)


@kernel
def _grown(array: Indices, least: int) -> Indices:
    bigger = np.empty(max(2 * array.shape[0], least), np.int64)
    bigger[: array.shape[0]] = array
    return bigger


@kernel
def _fit_cost(
    line: Array, p: Array, cos_max_angle: float, max_offset: float, max_gap: float
) -> float:
    """Return how ill a piece fits a line, 0 = perfectly; inf where they must not merge.

    The offset is taken where the two overlap (in the middle of it, or of the gap), by either line
    alike: far ends of long lines at a small angle are no evidence of two walls.
    """
    lx, ly = line[X2] - line[X1], line[Y2] - line[Y1]
    px, py = p[X2] - p[X1], p[Y2] - p[Y1]
    l_length, p_length = math.hypot(lx, ly), math.hypot(px, py)
    lx, ly, px, py = lx / l_length, ly / l_length, px / p_length, py / p_length
    cosine = lx * px + ly * py
    if cosine < cos_max_angle:
        return np.inf
    start = (p[X1] - line[X1]) * lx + (p[Y1] - line[Y1]) * ly
    end = (p[X2] - line[X1]) * lx + (p[Y2] - line[Y1]) * ly
    low, high = max(start, 0.0), min(end, l_length)
    if low - high > max_gap:
        return np.inf
    middle = 0.5 * (low + high)
    across_start = -(p[X1] - line[X1]) * ly + (p[Y1] - line[Y1]) * lx
    slope = (lx * py - ly * px) / cosine
    offset = abs(across_start + (middle - start) * slope)
    if offset > max_offset:
        return np.inf
    cost: float = (offset / max_offset) ** 2 + (1.0 - cosine) / (1.0 - cos_max_angle)
    return cost


@kernel
def _merged(line: Array, p: Array, out: Array) -> None:
    """Sum the moments of both (Chan et al. 1979) and put the end points on the new line."""
    w = line[W] + p[W]
    dx, dy = p[CX] - line[CX], p[CY] - line[CY]
    part = p[W] / w
    out[W] = w
    out[CX] = line[CX] + part * dx
    out[CY] = line[CY] + part * dy
    out[SXX] = line[SXX] + p[SXX] + line[W] * part * dx * dx
    out[SXY] = line[SXY] + p[SXY] + line[W] * part * dx * dy
    out[SYY] = line[SYY] + p[SYY] + line[W] * part * dy * dy
    ux, uy = _direction(
        out, line[X2] - line[X1] + p[X2] - p[X1], line[Y2] - line[Y1] + p[Y2] - p[Y1]
    )
    low = min(
        (line[X1] - out[CX]) * ux + (line[Y1] - out[CY]) * uy,
        (p[X1] - out[CX]) * ux + (p[Y1] - out[CY]) * uy,
    )
    high = max(
        (line[X2] - out[CX]) * ux + (line[Y2] - out[CY]) * uy,
        (p[X2] - out[CX]) * ux + (p[Y2] - out[CY]) * uy,
    )
    out[X1], out[Y1] = out[CX] + low * ux, out[CY] + low * uy
    out[X2], out[Y2] = out[CX] + high * ux, out[CY] + high * uy


@kernel
def _direction(moments: Array, toward_x: float, toward_y: float) -> tuple[float, float]:
    """Return the unit vector of the total least squares line, turned toward a given direction."""
    theta = 0.5 * math.atan2(2.0 * moments[SXY], moments[SXX] - moments[SYY])
    ux, uy = math.cos(theta), math.sin(theta)
    if ux * toward_x + uy * toward_y < 0.0:
        ux, uy = -ux, -uy
    return ux, uy


@kernel
def _spread(moments: Array) -> float:
    """Return the rms distance of the mass from its line [m]."""
    half_sum = 0.5 * (moments[SXX] + moments[SYY])
    half_difference = 0.5 * (moments[SXX] - moments[SYY])
    least = half_sum - math.hypot(half_difference, moments[SXY])
    return math.sqrt(max(least, 0.0) / moments[W])


@kernel
def extents(endpoints: Array, labels: Indices, lines: Array) -> Array:
    """Return per line the two lowest starts, the two highest ends of its observations: (m, 4).

    Positions along the line, measured from its centroid [m]; the second is infinite where there is
    one observation only.
    """
    found = np.empty((lines.shape[0], 4))
    found[:, :2] = np.inf
    found[:, 2:] = -np.inf
    for i in range(endpoints.shape[0]):
        line = lines[labels[i]]
        ux, uy = line[X2] - line[X1], line[Y2] - line[Y1]
        length = math.hypot(ux, uy)
        ux, uy = ux / length, uy / length
        start = (endpoints[i, 0] - line[CX]) * ux + (endpoints[i, 1] - line[CY]) * uy
        end = (endpoints[i, 2] - line[CX]) * ux + (endpoints[i, 3] - line[CY]) * uy
        f = found[labels[i]]
        if start < f[0]:
            f[0], f[1] = start, f[0]
        elif start < f[1]:
            f[1] = start
        if end > f[2]:
            f[2], f[3] = end, f[2]
        elif end > f[3]:
            f[3] = end
    return found
