"""Numba kernels for scans that share parallel walls only: a band, free to slide along itself."""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._kernels import LENGTH, THETA, X1, X2, Y1, Y2
from lineloom_core.kernels import kernel
from lineloom_core.matching._agreement_kernels import AXIS, BROAD
from lineloom_core.matching._free_space_kernels import CONFLICT, MATCHED, judge_thinned, thin_points
from lineloom_core.matching._proposal_kernels import (
    LONG_ENOUGH,
    compatible_pairs,
    rotation_peaks,
    wrap_angle,
)

PER_ROTATION, WINDOW, TRIED = 3, 0.15, 6
"""Bands per rotation, how far off [m] walls agree on the offset across, bands looked at."""
FARTHEST_SLIDE, SLIDE_STEP, SLIDE_STRIDE = 5.0, 0.25, 0.2
SLIDE_BASE, SLIDE_SLOPE = 0.16, 0.01
PER_BAND, LEAST_SLIDE, WORTH_A_LOOK = 3, 0.5, 0.6


@kernel
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


@kernel
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


@kernel
def slide_profile(ref, cur, ref_thin, cur_thin, band, profile):  # type: ignore[no-untyped-def]
    """Metres matched less twice those in conflict at every slide along a band, from end to end."""
    phi, axis, across = band[0], band[1], band[2]
    ux, uy = math.cos(axis), math.sin(axis)
    counts, pose = np.empty(4), np.empty(3)
    pose[2] = phi
    n = profile.shape[0] // 2
    for k in range(-n, n + 1):
        pose[0] = -uy * across + ux * k * SLIDE_STEP
        pose[1] = ux * across + uy * k * SLIDE_STEP
        judge_thinned(ref, cur, ref_thin, cur_thin, pose, SLIDE_BASE, SLIDE_SLOPE, counts)
        profile[k + n] = SLIDE_STRIDE * (counts[MATCHED] - 2.0 * counts[CONFLICT])


@kernel
def propose_slides(ref, cur, table, kept, figures, rotations, most):  # type: ignore[no-untyped-def]
    """The likeliest slides along all bands, as rows x, y, theta, weight, weight; likeliest first.

    Bands are those of parallel walls, and the one that the best of `kept` hypotheses lies on.
    """
    found = propose_bands(ref.lines, cur.lines, rotations, PER_ROTATION, WINDOW)
    bands = np.empty((min(found.shape[0], TRIED) + 1, 5))
    count = 0
    if kept > 0:
        axis = figures[AXIS]
        bands[0, 0], bands[0, 1] = table[0, 2], axis
        bands[0, 2] = math.cos(axis) * table[0, 1] - math.sin(axis) * table[0, 0]
        bands[0, 3], bands[0, 4] = figures[BROAD], 1.0
        count = 1
    for k in range(min(found.shape[0], TRIED)):
        bands[count] = found[k]
        count += 1
    ref_thin = thin_points(ref.points, ref.angle_increment, SLIDE_STRIDE)
    cur_thin = thin_points(cur.points, cur.angle_increment, SLIDE_STRIDE)
    n = int(FARTHEST_SLIDE / SLIDE_STEP)
    profile = np.empty(2 * n + 1)
    rows, values = np.empty((count * PER_BAND, 5)), np.empty(count * PER_BAND)
    m = 0
    for b in range(count):
        slide_profile(ref, cur, ref_thin, cur_thin, bands[b], profile)
        ux, uy = math.cos(bands[b, 1]), math.sin(bands[b, 1])
        for _ in range(PER_BAND):
            k = int(profile.argmax())
            if profile[k] < LEAST_SLIDE:
                break
            along = (k - n) * SLIDE_STEP
            rows[m, 0] = -uy * bands[b, 2] + ux * along
            rows[m, 1] = ux * bands[b, 2] + uy * along
            rows[m, 2], rows[m, 3], rows[m, 4] = bands[b, 0], bands[b, 3], bands[b, 3]
            values[m] = profile[k]
            profile[max(k - 1, 0) : k + 2] = -1e9
            m += 1
    order = np.argsort(-values[:m], kind="mergesort")
    keep = 0
    while keep < min(m, most) and values[order[keep]] >= WORTH_A_LOOK * values[order[0]]:
        keep += 1
    return rows[order[:keep]]
