"""Algorithm 1, Split-and-Merge (§3.2): line segments out of the points of one scan."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.matching.thesis.config import PrimitiveConfig
from lineloom_core.matching.thesis.line_segments import LineSegments

Run = tuple[int, int]
"""First and last index of consecutive points, both included."""

MAX_BEAM_GAP = 6
"""Beams without a return that do not end a surface."""


def split_and_merge(
    points: NDArray[np.float64],
    beams: NDArray[np.int64],
    angle_increment: float,
    config: PrimitiveConfig,
) -> LineSegments:
    """Extract line segments, end points not yet classified (Algorithm 1).

    points: (n, 2) [m], counter-clockwise around the laser at the origin; beams: (n,) their beam
    indices. Departures (`core/docs/thesis.md`): one initial set per surface instead of one in all;
    the line of a set is its chord while splitting and the total least-squares line afterwards; a
    split point goes to the line it lies nearer to; only neighbouring sets are merged.
    """
    unprocessed = surfaces(points, beams, angle_increment, config)[::-1]  # step 1
    sets: list[Run] = []
    while unprocessed:
        first, last = unprocessed.pop()  # step 2: fit a line to the next unprocessed set
        j, distance = farthest_point(points, first, last)  # step 3
        if distance < config.split:  # step 4
            sets.append((first, last))
        else:  # step 5: split at p_j; the earlier half is processed next
            unprocessed += [(j, last), (first, j)]
    sets = merge_collinear(points, part(points, sets), config)  # step 6
    return fit_segments(points, beams, sets, config)


def surfaces(
    points: NDArray[np.float64],
    beams: NDArray[np.int64],
    angle_increment: float,
    config: PrimitiveConfig,
) -> list[Run]:
    """Cut the points where neighbours lie too far apart to be one surface (adaptive break points).

    Two returns of one surface are at most r sin(d) / sin(break_angle - d) apart when the beams,
    d apart, meet it no flatter than break_angle.
    """
    if len(points) == 0:
        return []
    if config.break_angle == 0.0:
        return [(0, len(points) - 1)]
    between = np.diff(beams) * angle_increment
    r = np.hypot(points[:, 0], points[:, 1])
    flattest = np.maximum(config.break_angle, 1.5 * between)
    limit = np.minimum(r[:-1], r[1:]) * np.sin(between) / np.sin(flattest - 0.7 * between)
    apart = np.hypot(*np.diff(points, axis=0).T)
    broken = (apart > limit + 3.0 * config.sigma) | (np.diff(beams) > MAX_BEAM_GAP)
    cuts = np.flatnonzero(broken)
    firsts, lasts = [0, *(cuts + 1).tolist()], [*cuts.tolist(), len(points) - 1]
    return list(zip(firsts, lasts, strict=True))


def farthest_point(points: NDArray[np.float64], first: int, last: int) -> tuple[int, float]:
    """Index and distance [m] of the point farthest from the chord p_first p_last.

    The end points themselves never win: a set of one or two points is a line.
    """
    if last - first < 2:
        return first, 0.0
    chord = points[last] - points[first]
    inner = points[first + 1 : last] - points[first]
    norm = math.hypot(*chord)
    if norm < 1e-9:
        distances = np.hypot(inner[:, 0], inner[:, 1])
    else:
        distances = np.abs(chord[0] * inner[:, 1] - chord[1] * inner[:, 0]) / norm
    j = int(np.argmax(distances))
    return first + 1 + j, float(distances[j])


def part(points: NDArray[np.float64], sets: list[Run]) -> list[Run]:
    """Give every split point, which two sets share, to the one whose line it lies nearer to."""
    parted = list(sets)
    for i in range(len(parted) - 1):
        (a, j), (j_next, b) = parted[i], parted[i + 1]
        if j != j_next:
            continue
        before = _distance_to_fit(points, (a, j - 1), j)
        after = _distance_to_fit(points, (j + 1, b), j)
        if after < before:
            parted[i] = (a, j - 1)
        else:
            parted[i + 1] = (j + 1, b)
    return [(a, b) for a, b in parted if b >= a]


def merge_collinear(
    points: NDArray[np.float64], sets: list[Run], config: PrimitiveConfig
) -> list[Run]:
    """Join neighbouring sets that lie on one line, until none are left to join."""
    merged: list[Run] = []
    for first, last in sets:
        run = (first, last)
        while merged and _are_collinear(points, merged[-1], run, config):
            run = (merged.pop()[0], last)
        merged.append(run)
    return merged


def _are_collinear(
    points: NDArray[np.float64], before: Run, after: Run, config: PrimitiveConfig
) -> bool:
    """Do two neighbouring sets lie on one line, with no hole that could be a doorway?"""
    (a, j), (k, b) = before, after
    if max(j - a, b - k) < 2 or b - a + 1 < config.min_points:
        return False
    if k != j + 1 and math.hypot(*(points[k] - points[j])) > config.max_gap:
        return False
    centre, u = fit_line(points[a : b + 1])
    deviation = np.abs(_across(points[a : b + 1] - centre, u))
    return float(deviation.max()) < config.merge_factor * config.split


def fit_line(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Total least squares: centroid (2,) [m] and unit direction (2,), first to last point.

    points: (n, 2), n >= 2. Departure: the text says least squares; of y on x, walls along y would
    have no line.
    """
    centre = points.mean(axis=0)
    x, y = (points - centre).T
    theta = 0.5 * math.atan2(2.0 * float(x @ y), float(x @ x - y @ y))
    u = np.array([math.cos(theta), math.sin(theta)])
    return centre, u if float(u @ (points[-1] - points[0])) >= 0.0 else -u


def fit_segments(
    points: NDArray[np.float64],
    beams: NDArray[np.int64],
    sets: list[Run],
    config: PrimitiveConfig,
) -> LineSegments:
    """Fit a line to every set that is long and full enough; its ends are the end points' feet."""
    rows, hit = [], []
    for a, b in sets:
        if b - a + 1 < config.min_points:
            continue
        centre, u = fit_line(points[a : b + 1])
        start = centre + u * float(u @ (points[a] - centre))
        end = centre + u * float(u @ (points[b] - centre))
        free_side_left = float(_across(-centre, u)) > 0.0
        if free_side_left and math.hypot(*(end - start)) >= config.min_length:
            rows.append([*start, *end])
            hit.append([beams[a], beams[b]])
    return LineSegments.of(rows, beams=hit)


def _across(v: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Components of v (..., 2) along the left normal of u (2,)."""
    across: NDArray[np.float64] = u[0] * v[..., 1] - u[1] * v[..., 0]
    return across


def _distance_to_fit(points: NDArray[np.float64], run: Run, j: int) -> float:
    """Distance of p_j from the line of a set; infinite where the set is too small for one."""
    a, b = run
    if b - a < 1:
        return math.inf
    centre, u = fit_line(points[a : b + 1])
    return abs(float(_across(points[j] - centre, u)))
