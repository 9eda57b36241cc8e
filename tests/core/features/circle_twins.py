"""Slow, obvious twins of `lineloom_core.features._circle_kernels`."""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.features._kernels import FIRST, LAST, LENGTH, THETA
from lineloom_core.geometry import wrap
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tests.core.features import slow_twins as slow

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def algebraic(points: Floats) -> Floats:
    """x, y, r of the least sum of (d^2 - r^2)^2: linear in 2x, 2y and r^2 - x^2 - y^2."""
    matrix = np.column_stack([2.0 * points, np.ones(len(points))])
    x, y, rest = np.linalg.lstsq(matrix, np.sum(points**2, axis=1), rcond=None)[0]
    return np.array([x, y, math.sqrt(rest + x * x + y * y)])


def distances(circle: Floats, points: Floats) -> Floats:
    off: Floats = np.hypot(*(points - circle[:2]).T) - circle[2]
    return off


def geometric(points: Floats) -> tuple[Floats, float, Floats]:
    """Circle of least squared distances, their sum, and (J'J)^-1."""
    found = least_squares(distances, algebraic(points), args=(points,), xtol=1e-14, ftol=1e-14)
    units = (points - found.x[:2]) / np.hypot(*(points - found.x[:2]).T)[:, None]
    J = np.column_stack([-units, -np.ones(len(points))])
    return found.x, float(np.sum(found.fun**2)), np.linalg.inv(J.T @ J)


def covariance(points: Floats, circle: Floats, sigma: float) -> Floats:
    """Of x, y, r, for noise along the beams from the origin, measured with four points' prior."""
    off, n = distances(circle, points), len(points)
    units = (points - circle[:2]) / np.hypot(*(points - circle[:2]).T)[:, None]
    beams = points / np.hypot(*points.T)[:, None]
    across = np.maximum(np.sum(units * beams, axis=1) ** 2, 0.04)
    J = np.column_stack([units, np.ones(n)])
    var = (off @ off + 4.0 * sigma**2) / (across.sum() * (n - 3) / n + 4.0)
    gain = np.linalg.inv(J.T @ J) @ J.T
    spread: Floats = var * gain @ np.diag(across) @ gain.T
    return spread


def extent(points: Floats, circle: Floats) -> tuple[float, float]:
    """A full turn less the widest gap between points about the centre; gaps below 6 deg."""
    angles = np.sort(np.arctan2(*(points - circle[:2]).T[::-1]))
    gaps = np.diff(angles)
    widest = max(float(gaps.max()), float(angles[0] + math.tau - angles[-1]))
    return math.tau - widest, float(gaps[gaps < math.radians(6.0)].sum())


def two_lines(points: Floats) -> float:
    """Least sum of squared distances to two lines of at least three points, split in order."""
    n = len(points)
    return min(
        slow.total_least_squares(points[:cut])[2] + slow.total_least_squares(points[cut:])[2]
        for cut in range(3, n - 2)
    )


def small_and_bent(xy: Floats, breaks: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    found, first = [], 0
    for last in np.flatnonzero(breaks).tolist():
        chord = float(np.linalg.norm(xy[last] - xy[first]))
        if last - first + 1 >= least and chord < 1.4:
            where, deep = slow.farthest(xy, first, last)
            along = (xy[last] - xy[first]) @ (xy[where] - xy[first])
            if deep > max(0.04, math.sqrt(0.008) * chord) and 0.2 < along / chord**2 < 0.8:
                found.append((first, last))
        first = last + 1
    return found


def runs_of_chords(lines: Floats, place: Ints) -> list[tuple[int, int]]:
    """First and last point of two or more short lines, next to each other, turning one way."""
    runs: list[list[int]] = [[0]]
    for i in range(1, len(lines)):
        before, turn = runs[-1], wrap(lines[i][THETA] - lines[i - 1][THETA])
        gap = place[int(lines[i][FIRST])] - place[int(lines[i - 1][LAST])]
        joins = max(lines[i][LENGTH], lines[i - 1][LENGTH]) < 2.5 and 0 <= gap <= 3
        joins = joins and math.radians(1.5) < abs(turn) < math.radians(55.0)
        if joins and len(before) > 1:
            way = wrap(lines[before[1]][THETA] - lines[before[0]][THETA])
            if way * turn < 0.0:  # turns the other way: its last chord begins the next run
                runs.append([i - 1, i])
                continue
        if joins:
            before.append(i)
        else:
            runs.append([i])
    return [
        (int(place[int(lines[r[0]][FIRST])]), int(place[int(lines[r[-1]][LAST])]))
        for r in runs
        if len(r) >= 2
    ]
