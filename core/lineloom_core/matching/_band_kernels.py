"""Numba kernels for scans that share parallel walls only: a band, free to slide along itself."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lineloom_core.features._kernels import LENGTH, THETA, X1, X2, Y1, Y2
from lineloom_core.matching._free_space_kernels import CONFLICT, MATCHED, judge_pair
from lineloom_core.matching._kernels import evidence, fill_row
from lineloom_core.matching._proposal_kernels import (
    LONG_ENOUGH,
    compatible_pairs,
    rotation_peaks,
    wrap_angle,
)
from lineloom_core.matching._refinement_kernels import refine

COARSE_STEP = 10


@njit(cache=True)
def band_offsets(ref, cur, phi, axis, pairs, count, values, weights, sides):  # type: ignore[no-untyped-def]
    """Constraints n . t = value of all pairs parallel to `axis`; side +1 or -1 by facing."""
    nx, ny = -math.sin(axis), math.cos(axis)
    c, s = math.cos(phi), math.sin(phi)
    m = 0
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        d = wrap_angle(ref[i, THETA] - axis)
        facing = 1.0
        if abs(d) > 0.5 * math.pi:
            facing = -1.0
            d = wrap_angle(d + math.pi)
        if abs(d) > math.radians(5.0):
            continue
        mx, my = 0.5 * (cur[j, X1] + cur[j, X2]), 0.5 * (cur[j, Y1] + cur[j, Y2])
        rx, ry = c * mx - s * my, s * mx + c * my
        rm, rn = 0.5 * (ref[i, X1] + ref[i, X2]), 0.5 * (ref[i, Y1] + ref[i, Y2])
        values[m] = nx * (rm - rx) + ny * (rn - ry)
        weights[m] = min(ref[i, LENGTH], cur[j, LENGTH], LONG_ENOUGH)
        sides[m] = facing
        m += 1
    return m


@njit(cache=True)
def propose_bands(ref, cur, rotations, per_rotation, window):  # type: ignore[no-untyped-def]
    """Rows phi, axis, offset across, weight, both sides seen (1) or one (0); heaviest first."""
    phis = rotation_peaks(ref, cur, rotations, 0.25, math.radians(3.0))
    table = np.empty((phis.shape[0] * per_rotation, 5))
    pairs = np.empty((150, 2), dtype=np.int64)
    values, weights, sides = np.empty(150), np.empty(150), np.empty(150)
    rows = 0
    for f in range(phis.shape[0]):
        phi = phis[f]
        count = compatible_pairs(ref, cur, phi, math.radians(5.0), 150, pairs)
        if count == 0:
            continue
        heaviest, axis = -1.0, 0.0
        for p in range(count):
            w = min(ref[pairs[p, 0], LENGTH], cur[pairs[p, 1], LENGTH])
            if w > heaviest:
                heaviest, axis = w, ref[pairs[p, 0], THETA]
        m = band_offsets(ref, cur, phi, axis, pairs, count, values, weights, sides)
        used = np.zeros(m, dtype=np.bool_)
        for _ in range(per_rotation):
            best, where = 0.0, -1
            for a in range(m):
                if used[a]:
                    continue
                one = other = 0.0
                for b in range(m):
                    d = abs(values[b] - values[a])
                    if d < window:
                        w = weights[b] * (1.0 - 0.5 * d / window)
                        if sides[b] == sides[a]:
                            one += w
                        else:
                            other += w
                total = one + other + min(one, other)
                if total > best:
                    best, where = total, a
            if where < 0:
                break
            centre = values[where]
            mean = weight = left = right = 0.0
            for b in range(m):
                if abs(values[b] - centre) < window:
                    mean += weights[b] * values[b]
                    weight += weights[b]
                    if sides[b] > 0:
                        left += weights[b]
                    else:
                        right += weights[b]
                if abs(values[b] - centre) < 1.5 * window:
                    used[b] = True
            table[rows, 0], table[rows, 1] = phi, axis
            table[rows, 2], table[rows, 3] = mean / weight, best
            table[rows, 4] = 1.0 if left > 0.3 and right > 0.3 else 0.0
            rows += 1
    return table[:rows][np.argsort(-table[:rows, 3], kind="mergesort")]


@njit(cache=True)
def slide_band(  # type: ignore[no-untyped-def]
    ref_points,
    ref_ranges,
    ref_min,
    ref_inc,
    cur_points,
    cur_ranges,
    cur_min,
    cur_inc,
    phi,
    axis,
    across,
    farthest,
    step,
    base,
    slope,
):
    """The slide along a band that free space likes best: x, y, theta, matched less conflicts."""
    ux, uy = math.cos(axis), math.sin(axis)
    counts = np.empty(4)
    pose = np.empty(3)
    best = np.array([0.0, 0.0, phi, -1e9])
    n = int(farthest / step)
    for k in range(-n, n + 1):
        pose[0] = -uy * across + ux * k * step
        pose[1] = ux * across + uy * k * step
        pose[2] = phi
        judge_pair(
            ref_points, ref_ranges, ref_min, ref_inc, cur_points, cur_ranges, cur_min, cur_inc,
            pose, COARSE_STEP, base + 0.05, slope, counts,
        )  # fmt: skip
        value = COARSE_STEP * (counts[MATCHED] - 3.0 * counts[CONFLICT])
        if value > best[3]:
            best[0], best[1], best[3] = pose[0], pose[1], value
    return best


@njit(cache=True)
def match_bands(  # type: ignore[no-untyped-def]
    ref,
    ref_ends,
    ref_edges,
    ref_points,
    ref_ranges,
    ref_min,
    ref_inc,
    cur,
    cur_ends,
    cur_edges,
    cur_points,
    cur_ranges,
    cur_min,
    cur_inc,
    rotations,
    per_rotation,
    window,
    tried,
    farthest,
    step,
    iterations,
    base,
    slope,
):
    """Bands slid to where free space likes them, refined and judged; best evidence first.

    Rows: the 16 columns of `_kernels.match_sweeps` (explained and votes are the band's weight),
    then the band's axis, weight, and whether both sides were seen.
    """
    bands = propose_bands(ref, cur, rotations, per_rotation, window)
    n = min(bands.shape[0], tried)
    out = np.empty((n, 19))
    H = np.empty((3, 3))
    counts = np.empty(4)
    rank = np.empty(n)
    for k in range(n):
        phi, axis, across, weight, both = bands[k]
        slid = slide_band(
            ref_points, ref_ranges, ref_min, ref_inc, cur_points, cur_ranges, cur_min, cur_inc,
            phi, axis, across, farthest, step, base, slope,
        )  # fmt: skip
        pose = slid[:3].copy()
        overlap = refine(ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, pose, H, iterations)
        judge_pair(
            ref_points, ref_ranges, ref_min, ref_inc, cur_points, cur_ranges, cur_min, cur_inc,
            pose, 1, base, slope, counts,
        )  # fmt: skip
        fill_row(out[k], pose, weight, weight, counts, overlap, H)
        out[k, 16], out[k, 17], out[k, 18] = axis, weight, both
        rank[k] = evidence(out[k])
    return out[np.argsort(-rank, kind="mergesort")]
