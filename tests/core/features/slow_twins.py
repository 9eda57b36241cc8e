"""Slow, obvious twins of `lineloom_core.features._kernels`, written from the thesis and §3."""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.features import EDGE, INTERIOR, UNKNOWN, ExtractionConfig
from lineloom_core.features._kernels import FIRST, LAST, OFFSET, THETA, X1, X2, Y1, Y2
from lineloom_core.geometry import wrap
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Run = tuple[int, int, int]


def points_of(ranges: Floats, angle_min: float, increment: float) -> tuple[Floats, Ints]:
    beams = np.flatnonzero(np.isfinite(ranges))
    angles = angle_min + beams * increment
    r = ranges[beams]
    return np.column_stack([r * np.cos(angles), r * np.sin(angles)]), beams


def chains_of(
    xy: Floats, beam: Ints, increment: float, lam: float, sigma: float, max_gap: int
) -> list[list[int]]:
    """Each point goes to the nearest of the four newest surfaces that admits it."""
    chains: list[list[int]] = []
    for k in range(len(xy)):
        near: list[tuple[float, list[int]]] = []
        for chain in chains[::-1][:4]:
            t = chain[-1]
            skipped = int(beam[k] - beam[t])
            dphi = skipped * increment
            shorter = min(np.linalg.norm(xy[t]), np.linalg.norm(xy[k]))
            flattest = max(lam, 1.5 * dphi)
            limit = shorter * math.sin(dphi) / math.sin(flattest - 0.7 * dphi) + 3.0 * sigma
            distance = float(np.linalg.norm(xy[k] - xy[t]))
            if skipped <= max_gap and distance < limit:
                near.append((distance, chain))
        if near:
            min(near, key=lambda entry: entry[0])[1].append(k)
        else:
            chains.append([k])
    return chains


def distance_to_chord(p: Floats, a: Floats, b: Floats) -> float:
    chord = b - a
    length = float(np.linalg.norm(chord))
    if length < 1e-9:
        return float(np.linalg.norm(p - a))
    return abs(float(chord[0] * (p - a)[1] - chord[1] * (p - a)[0])) / length


def farthest(xy: Floats, a: int, b: int) -> tuple[int, float]:
    distances = [distance_to_chord(xy[k], xy[a], xy[b]) for k in range(a + 1, b)]
    k = int(np.argmax(distances))
    return a + 1 + k, distances[k]


def split(xy: Floats, a: int, b: int, threshold: float) -> list[tuple[int, int]]:
    """Iterative end point fit, by recursion."""
    if b - a < 2:
        return [(a, b)]
    k, distance = farthest(xy, a, b)
    if distance <= threshold:
        return [(a, b)]
    return split(xy, a, k, threshold) + split(xy, k, b, threshold)


def split_all(xy: Floats, breaks: NDArray[np.bool_], threshold: float) -> list[Run]:
    runs: list[Run] = []
    first = 0
    for cluster, last in enumerate(np.flatnonzero(breaks).tolist()):
        runs += [(a, b, cluster) for a, b in split(xy, first, last, threshold)]
        first = last + 1
    return runs


def total_least_squares(points: Floats) -> tuple[Floats, Floats, float, float]:
    """Centroid, direction from the first to the last point, squared spread across and along."""
    centre = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - centre, full_matrices=False)
    direction = axes[0] if axes[0] @ (points[-1] - points[0]) >= 0.0 else -axes[0]
    return centre, direction, float(spread[1] ** 2), float(spread[0] ** 2)


def worst_deviation(points: Floats, centre: Floats, direction: Floats) -> float:
    normal = np.array([-direction[1], direction[0]])
    return float(np.abs((points - centre) @ normal).max())


def merge(xy: Floats, runs: list[Run], limit: float, min_points: int, max_gap: float) -> list[Run]:
    """Join each run to the one before where both lie on one line with no gap between."""
    merged: list[Run] = []
    for run in runs:
        if not merged:
            merged.append(run)
            continue
        before = merged[-1]
        together = xy[before[0] : run[1] + 1]
        touching = before[2] == run[2] or np.linalg.norm(xy[before[1]] - xy[run[0]]) < max_gap
        a_line = max(before[1] - before[0], run[1] - run[0]) >= 2 and len(together) >= min_points
        if touching and a_line:
            centre, direction, _, _ = total_least_squares(together)
            if worst_deviation(together, centre, direction) < limit:
                merged[-1] = (before[0], run[1], before[2])
                continue
        merged.append(run)
    return merged


def trimmed(runs: list[Run], q: int, min_points: int) -> tuple[int, int]:
    """A run without the split points that it shares with its neighbours, if it can spare them."""
    a, b, _ = runs[q]
    if b - a + 1 > min_points + 1:
        shares_first = q > 0 and runs[q - 1][1] == a
        shares_last = q + 1 < len(runs) and runs[q + 1][0] == b
        return a + shares_first, b - shares_last
    return a, b


def lines_of(
    xy: Floats, beam: Ints, runs: list[Run], sigma: float, min_points: int, min_length: float
) -> Floats:
    rows = []
    for q in range(len(runs)):
        a, b = trimmed(runs, q, min_points)
        points = xy[a : b + 1]
        if len(points) < min_points:
            continue
        centre, direction, across, along = total_least_squares(points)
        normal = np.array([-direction[1], direction[0]])
        start = centre + direction * (direction @ (points[0] - centre))
        end = centre + direction * (direction @ (points[-1] - centre))
        length, offset = float(direction @ (end - start)), float(normal @ centre)
        if length < min_length or offset >= 0.0:
            continue
        variance = max(across / max(len(points) - 2, 1), sigma**2)
        theta = math.atan2(direction[1], direction[0])
        figures = [theta, offset, length, variance / along, variance / len(points)]
        rows.append([*start, *end, *figures, len(points), beam[a], beam[b]])
    return np.array(rows, dtype=np.float64).reshape(-1, 12)


def corner_of(p: Floats, q: Floats) -> Floats | None:
    """Where two infinite lines meet; None below ten degrees."""
    normals = np.array([[-math.sin(a), math.cos(a)] for a in (p[THETA], q[THETA])])
    if abs(math.sin(p[THETA] - q[THETA])) <= 0.17:
        return None
    corner: Floats = np.linalg.solve(normals, np.array([p[OFFSET], q[OFFSET]]))
    return corner


def range_along(line: Floats, angle: float) -> float:
    """How far a beam goes until it meets the infinite line."""
    start, along = line[[X1, Y1]], np.array([math.cos(line[THETA]), math.sin(line[THETA])])
    beam = np.array([math.cos(angle), math.sin(angle)])
    matrix = np.column_stack([beam, -along])
    if abs(np.linalg.det(matrix)) < 1e-6:
        return math.inf
    r = float(np.linalg.solve(matrix, start)[0])
    return r if r > 0.0 else math.inf


def end_of(
    lines: Floats,
    i: int,
    side: int,
    ranges: Floats,
    angle_min: float,
    increment: float,
    sigma: float,
    full_turn: bool,
    reach: float,
) -> tuple[int, Floats]:
    """Type and edge point of one end: angle edge, else jump edge, else interior or unknown."""
    n, beams, step = len(lines), len(ranges), 1 if side else -1
    here = lines[i][[X2, Y2]] if side else lines[i][[X1, Y1]]
    beam = int(lines[i][LAST if side else FIRST])
    j = (i + step) % n if full_turn else i + step
    if 0 <= j < n and j != i:
        there = lines[j][[X1, Y1]] if side else lines[j][[X2, Y2]]
        gap = (int(lines[j][FIRST if side else LAST]) - beam) * step
        gap += beams if full_turn and gap < 0 else 0
        corner = corner_of(lines[i], lines[j])
        if 0 <= gap <= 3 and corner is not None:
            near = max(np.linalg.norm(corner - here), np.linalg.norm(corner - there)) < reach
            direction = math.atan2(corner[1], corner[0]) - (angle_min + beam * increment)
            beyond = step * wrap(direction) / increment
            if near and -1.5 <= beyond <= gap + 1.5:
                return EDGE, corner
    k = (beam + step) % beams if full_turn else beam + step
    if not 0 <= k < beams:
        return INTERIOR, here
    if not math.isfinite(ranges[k]):
        return UNKNOWN, here
    goes_on = range_along(lines[i], angle_min + k * increment)
    jumps = ranges[k] > goes_on + 3.0 * sigma + 0.05 + 0.005 * ranges[k]
    return (EDGE if jumps else INTERIOR), here


def normals_of(xy: Floats, breaks: NDArray[np.bool_], reach: int) -> Floats:
    normals = np.zeros_like(xy)
    first = 0
    for last in np.flatnonzero(breaks).tolist():
        for k in range(first, last + 1):
            around = xy[max(first, k - reach) : min(last, k + reach) + 1]
            if len(around) < 3:
                continue
            values, vectors = np.linalg.eigh(np.cov(around.T, bias=True))
            if values[0] > 0.1 * values[1]:
                continue
            normal = vectors[:, 0]
            normals[k] = -normal if normal @ xy[k] > 0.0 else normal
        first = last + 1
    return normals


def extract(
    ranges: Floats, angle_min: float, increment: float, config: ExtractionConfig
) -> tuple[Floats, Ints, NDArray[np.bool_], Floats, Ints, Floats]:
    """All of §3, step by step: points, beams, breaks, lines, ends, edges."""
    c = config
    xy, beam = points_of(ranges, angle_min, increment)
    chains = chains_of(xy, beam, increment, c.break_angle, c.sigma, c.max_gap_beams)
    order = np.array([k for chain in chains for k in chain], dtype=np.int64)
    breaks = np.zeros(len(xy), dtype=np.bool_)
    breaks[np.cumsum([len(chain) for chain in chains], dtype=np.int64) - 1] = True
    xy, beam = xy[order], beam[order]
    runs = split_all(xy, breaks, c.split)
    runs = merge(xy, runs, c.merge_factor * c.split, c.min_points, c.max_gap)
    lines = lines_of(xy, beam, runs, c.sigma, c.min_points, c.min_length)
    full_turn = len(ranges) * increment > math.tau - 1.5 * increment
    ends = np.zeros((len(lines), 2), dtype=np.int64)
    edges = np.zeros((len(lines), 2, 2))
    for i in range(len(lines)):
        for side in range(2):
            ends[i, side], edges[i, side] = end_of(
                lines, i, side, ranges, angle_min, increment, c.sigma, full_turn, c.corner_reach
            )
    return xy, beam, breaks, lines, ends, edges
