"""Slow, obvious twins of `lineloom_core.places._kernels`."""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.geometry import Pose, wrap
from lineloom_core.matching import _free_space_kernels, _refinement_kernels
from lineloom_core.places import Place
from numpy.typing import NDArray

from tests.core.matching import slow_twins as pairwise

Floats = NDArray[np.float64]
Sweeps = list[tuple[Pose, pairwise.Sweep]]


def sweeps_of(place: Place) -> Sweeps:
    rows = zip(
        place.sweep_poses, place.ranges, place.angle_mins, place.angle_increments, strict=True
    )
    return [(Pose.from_array(pose), (ranges, a, step)) for pose, ranges, a, step in rows]


def judge_places(
    ref: Place, cur: Place, pose: Floats, step: int, base: float, slope: float, every: int = 1
) -> Floats:
    """Each place's points against the other's sweeps; every n-th sweep, every step-th point."""
    T = Pose.from_array(pose)
    there = pairwise.judge_cloud(
        cur.surface.points[::step], T, sweeps_of(ref)[::every], base, slope
    )
    back = pairwise.judge_cloud(
        ref.surface.points[::step], T.inverse(), sweeps_of(cur)[::every], base, slope
    )
    return there + back


def tally(
    place: Place, points: Floats, T_place_points: Pose, tolerance: tuple[float, float]
) -> Floats:
    """Sweep by sweep, point by point: who measured it, who saw through it."""
    rows = np.zeros((len(points), 2))
    for i, point in enumerate(points):
        for sweep in sweeps_of(place):
            counts = pairwise.judge_cloud(point[None, :], T_place_points, [sweep], *tolerance)
            rows[i, 0] += counts[_free_space_kernels.MATCHED]
            rows[i, 1] += counts[_free_space_kernels.CONFLICT]
    return rows


def evidence(row: Floats) -> float:
    """Metres of common line and cells of 0.1 m that both saw, less thrice what contradicts."""
    return float(row[9] + 0.1 * row[5] - 0.3 * row[6])


def cascade(
    ref: Place, cur: Place, proposals: Floats, coarse_keep: int, fine_keep: int, iterations: int,
    tolerance: tuple[float, float],
) -> Floats:  # fmt: skip
    """From proposals to judged hypotheses: coarse check, refinement, no twins, full check."""
    base, slope = tolerance
    ranked = []
    for row in proposals[:coarse_keep]:
        counts = judge_places(ref, cur, row[:3], 8, base + 0.15, slope + 0.01, every=3)
        ranked.append(
            row[3]
            + 0.4
            * (counts[_free_space_kernels.MATCHED] - 2.0 * counts[_free_space_kernels.CONFLICT])
        )
    best = sorted(range(len(ranked)), key=lambda k: -ranked[k])[:fine_keep]
    rows: list[Floats] = []
    for k in best:
        pose, H = proposals[k, :3].copy(), np.empty((3, 3))
        overlap = _refinement_kernels.refine(
            ref.lines, ref.ends, ref.edges, cur.lines, cur.ends, cur.edges, pose, H, iterations
        )
        is_twin = any(
            math.dist(row[:2], pose[:2]) < 0.15 and abs(wrap(row[2] - pose[2])) < 0.05
            for row in rows
        )
        if overlap > 0.0 and not is_twin:
            counts = 2.0 * judge_places(ref, cur, pose, 2, base, slope)
            rows.append(np.array([*pose, *proposals[k, 3:5], *counts, overlap]))
    return np.array(sorted(rows, key=lambda row: -evidence(row))).reshape(-1, 10)
