"""Numba kernels of the search for a step: seeds settle on the local map and are judged.

Slow twins: tests/core/matching/test_spots.py.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel
from lineloom_core.matching._free_space_kernels import (
    CONFLICT,
    MATCHED,
    invert_pose,
    judge_points,
)
from lineloom_core.matching._proposal_kernels import wrap_angle
from lineloom_core.matching._registration_kernels import register

UNMATCHED, STANDS_FREE, SEES_THROUGH = 10.0, 14.0, 10.0
"""What speaks against a spot (design §6): the scan's share on no known surface, its share in what
keyframes saw as free, and theirs in what it saw as free itself."""
LEAST_JUDGED = 0.2
"""Share of all points that counts as judged at least: a few in conflict are no contradiction."""
APPROACHED = 150, 5
"""Points of a scan, and iterations, with which a spot is approached before all points decide."""
CLOSE = 0.12
"""Gate [m] of what follows."""
HELD = 4.0
"""Information [1/m^2, 1/rad^2] that holds a spot at its seed where the scan says nothing."""
SPOT_COLUMNS = 16
HESSIAN, SPOT_MATCHED, TOTAL, RMS, MISFIT = 3, 12, 13, 14, 15
"""Columns of a spot, after x, y, theta: H row by row, registered weight matched and in all, rms [m]
of the matched, and what speaks against it."""


@kernel
def conflict_share(counts):  # type: ignore[no-untyped-def]
    """Conflict over what could be judged."""
    judged = max(counts[MATCHED] + counts[CONFLICT], LEAST_JUDGED * counts.sum())
    return counts[CONFLICT] / judged if judged > 0.0 else 0.0


@kernel
def between(a, b, out):  # type: ignore[no-untyped-def]
    """out = a^-1 b."""
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    out[0], out[1], out[2] = c * dx + s * dy, c * dy - s * dx, wrap_angle(b[2] - a[2])


@kernel
def misfit(scan, latest, most_back, pose, matched_share, base, slope):  # type: ignore[no-untyped-def]
    """What speaks against a scan at a pose; scan: `Sweep`, latest: `Latest`."""
    forth, back = np.zeros(4), np.zeros(4)
    T, inverse = np.empty(3), np.empty(3)
    for q in range(latest.poses.shape[0]):
        between(latest.poses[q], pose, T)
        judge_points(
            scan.points, scan.angle_increment, 1, T, latest.ranges[q], latest.angle_mins[q],
            latest.angle_increments[q], base, slope, forth,
        )  # fmt: skip
        if q < most_back:
            invert_pose(T, inverse)
            judge_points(
                latest.points[latest.begins[q] : latest.begins[q + 1]], latest.angle_increments[q],
                1, inverse, scan.ranges, scan.angle_min, scan.angle_increment, base, slope, back,
            )  # fmt: skip
    against = UNMATCHED * (1.0 - matched_share)
    return against + STANDS_FREE * conflict_share(forth) + SEES_THROUGH * conflict_share(back)


@kernel
def is_listed(rows, count, pose, near):  # type: ignore[no-untyped-def]
    """Is one of the first `count` rows nearly this pose?"""
    for k in range(count):
        d = math.hypot(rows[k, 0] - pose[0], rows[k, 1] - pose[1])
        if d < near and abs(wrap_angle(rows[k, 2] - pose[2])) < 0.03:
            return True
    return False


@kernel
def settle_spots(  # type: ignore[no-untyped-def]
    index, surface, ox, oy, points, normals, weights, seeds, gate, iterations, near,
    scan, latest, most_back, base, slope,
):  # fmt: skip
    """Register every seed (n, 3) on the local map and judge where it settles; each spot once.

    First by a part of the points, until the gate is CLOSE: a wide gate is what costs.
    """
    out = np.empty((seeds.shape[0], SPOT_COLUMNS))
    prior = np.full(3, HELD)
    weight = max(weights.sum(), 1e-9)
    every = max(1, points.shape[0] // APPROACHED[0])
    few, few_normals, few_weights = points[::every], normals[::every], weights[::every]
    count = 0
    for k in range(seeds.shape[0]):
        if near > 0.0 and is_listed(seeds, k, seeds[k], near):
            continue
        pose = seeds[k].copy()
        if iterations > 0 and every > 1:
            pose, H, stats = register(
                index, surface, ox, oy, few, few_normals, few_weights, pose, prior, gate, 0.03,
                APPROACHED[1],
            )  # fmt: skip
            if near > 0.0 and is_listed(out, count, pose, near):
                continue
        pose, H, stats = register(
            index, surface, ox, oy, points, normals, weights, pose, prior,
            CLOSE if iterations > 0 and every > 1 else gate, 0.03, iterations,
        )  # fmt: skip
        if near > 0.0 and is_listed(out, count, pose, near):
            continue
        out[count, :3] = pose
        out[count, HESSIAN:SPOT_MATCHED] = H.reshape(9)
        out[count, SPOT_MATCHED:MISFIT] = stats
        share = stats[0] / weight
        out[count, MISFIT] = misfit(scan, latest, most_back, pose, share, base, slope)
        count += 1
    return out[:count]
