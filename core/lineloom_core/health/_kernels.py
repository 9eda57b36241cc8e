"""Numba kernels of the checks of every scan. Slow twins: tests/core/health/test_kernels.py."""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._kernels import FIRST, LAST, LENGTH, OFFSET, THETA
from lineloom_core.kernels import kernel


@kernel(nogil=True)
def bulges(points, beams, lines, least_length, least_points, least_distance, steepest):  # type: ignore[no-untyped-def]
    """Each wall's share in the least-squares fit of epsilon (`bending`): rows of numerator and
    denominator [m^2].

    points (n, 2) of a scan, beams (n,) ascending, lines (m, 12).
    """
    found, walls = np.empty((len(lines), 2)), 0
    n = len(points)
    along, shape, height = np.empty(n), np.empty(n), np.empty(n)
    for k in range(len(lines)):
        distance = -lines[k, OFFSET]
        if lines[k, LENGTH] < least_length or distance < least_distance:
            continue
        a = np.searchsorted(beams, int(lines[k, FIRST]))
        b = np.searchsorted(beams, int(lines[k, LAST]) + 1)
        c, s = math.cos(lines[k, THETA]), math.sin(lines[k, THETA])
        n = 0
        for i in range(a, b):
            x = c * points[i, 0] + s * points[i, 1]
            bearing = math.atan2(x, distance)
            if abs(bearing) < steepest:
                along[n], shape[n] = x, bearing * x
                height[n] = c * points[i, 1] - s * points[i, 0] + distance
                n += 1
        if b - a < least_points or n < least_points:
            continue
        detrend(along[:n], shape[:n], height[:n])
        found[walls, 0] = (shape[:n] * height[:n]).sum()
        found[walls, 1] = (shape[:n] * shape[:n]).sum()
        walls += 1
    return found[:walls]


@kernel(nogil=True)
def detrend(along, one, other):  # type: ignore[no-untyped-def]
    """Take straight lines over `along`, which is centred, out of two series (n,)."""
    along -= along.mean()
    spread = (along * along).sum()
    for series in (one, other):
        series[:] -= series.mean()
        series[:] -= (series * along).sum() / spread * along


@kernel(nogil=True)
def profile(ranges, angle_min, angle_increment, sectors):  # type: ignore[no-untyped-def]
    """Mean range in each sector around the lidar [m], NaN without any."""
    total, count = np.zeros(sectors), np.zeros(sectors)
    for i in range(len(ranges)):
        if math.isfinite(ranges[i]):
            turns = (angle_min + angle_increment * i) / (2.0 * math.pi)
            sector = int((turns - math.floor(turns)) * sectors) % sectors
            total[sector] += ranges[i]
            count[sector] += 1.0
    for k in range(sectors):
        total[k] = total[k] / count[k] if count[k] > 0.0 else np.nan
    return total


@kernel(nogil=True)
def profiles_apart(a, b, shifts, far, least):  # type: ignore[no-untyped-def]
    """How far two profiles are apart, turned by up to `shifts` sectors so that they fit best [m].

    Differences count up to `far`; a turn at which fewer than `least` sectors are seen in both, too.
    """
    n, best = len(a), far
    for shift in range(-shifts, shifts + 1):
        total, both = 0.0, 0
        for k in range(n):
            difference = abs(a[k] - b[(k - shift) % n])
            if not math.isnan(difference):
                total += min(difference, far)
                both += 1
        if both >= least:
            best = min(best, total / both)
    return best


@kernel(nogil=True)
def median_step(ranges, apart):  # type: ignore[no-untyped-def]
    """Median of what finite ranges differ by from beam to beam so far apart [m]; and their number.

    0 apart: the ranges themselves.
    """
    steps, n = np.empty(len(ranges)), 0
    for i in range(len(ranges) - apart):
        step = abs(ranges[i + apart] - ranges[i]) if apart else ranges[i]
        if math.isfinite(step):
            steps[n] = step
            n += 1
    return (np.median(steps[:n]), n) if n else (0.0, 0)
