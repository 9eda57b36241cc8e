"""Numba kernels of the matcher's steps 1 to 3: rotations, translation votes, ranking.

Lines are rows as `ScanFeatures.lines` describes them; ends and edges go with them. Slow twins:
tests/core/matching/slow_twins.py.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._kernels import (
    EDGE,
    LENGTH,
    OFFSET,
    THETA,
    X1,
    X2,
    Y1,
    Y2,
)
from lineloom_core.kernels import kernel

BINS = 360
LONG_ENOUGH = 3.0
MOST_CELLS = 4096
"""Cells that may have votes."""


@kernel
def wrap_angle(a):  # type: ignore[no-untyped-def]
    """Wrap to [-pi, pi)."""
    return a - 2.0 * math.pi * math.floor((a + math.pi) / (2.0 * math.pi))


@kernel
def rotation_histogram(ref, cur):  # type: ignore[no-untyped-def]
    """Direction differences of all pairs of oriented lines, one degree a bin, shared over two."""
    h = np.zeros(BINS)
    scale = BINS / (2.0 * math.pi)
    for i in range(ref.shape[0]):
        for j in range(cur.shape[0]):
            w = min(ref[i, LENGTH], cur[j, LENGTH], LONG_ENOUGH)
            d = (wrap_angle(ref[i, THETA] - cur[j, THETA]) + math.pi) * scale - 0.5
            k = math.floor(d)
            f = d - k
            h[k % BINS] += w * (1.0 - f)
            h[(k + 1) % BINS] += w * f
    return h


@kernel
def rotation_peaks(ref, cur, most, least_share, reach):  # type: ignore[no-untyped-def]
    """Rotations phi with theta_ref = theta_cur + phi that many pairs agree on, best first."""
    h = rotation_histogram(ref, cur)
    smooth = np.empty(BINS)
    for k in range(BINS):
        smooth[k] = (
            h[(k - 2) % BINS] + 2.0 * h[(k - 1) % BINS] + 3.0 * h[k]
            + 2.0 * h[(k + 1) % BINS] + h[(k + 2) % BINS]
        )  # fmt: skip
    peaks = np.empty(most)
    used = np.zeros(BINS, dtype=np.bool_)
    count = 0
    best = smooth.max()
    while count < most:
        top, where = 0.0, -1
        for k in range(BINS):
            if not used[k] and smooth[k] > top:
                top, where = smooth[k], k
        if where < 0 or top < least_share * best:
            break
        for k in range(where - 4, where + 5):
            used[k % BINS] = True
        centre = (where + 0.5) * 2.0 * math.pi / BINS - math.pi
        total, mean = 0.0, 0.0
        for i in range(ref.shape[0]):
            for j in range(cur.shape[0]):
                d = wrap_angle(ref[i, THETA] - cur[j, THETA] - centre)
                if abs(d) < reach:
                    w = min(ref[i, LENGTH], cur[j, LENGTH], LONG_ENOUGH)
                    w = w * w
                    total += w
                    mean += w * d
        if total > 0.0:
            centre = wrap_angle(centre + mean / total)
        peaks[count] = centre
        count += 1
    return peaks[:count]


@kernel
def compatible_pairs(ref, cur, phi, tolerance, most, pairs):  # type: ignore[no-untyped-def]
    """Pairs (i, j) whose directions agree under phi; the `most` heaviest. Returns their count."""
    count = 0
    lightest = np.inf
    weights = np.empty(most)
    for i in range(ref.shape[0]):
        for j in range(cur.shape[0]):
            d = abs(wrap_angle(ref[i, THETA] - cur[j, THETA] - phi))
            if d > tolerance:
                continue
            w = min(ref[i, LENGTH], cur[j, LENGTH])
            if count < most:
                pairs[count, 0], pairs[count, 1] = i, j
                weights[count] = w
                count += 1
            else:
                if lightest == np.inf:
                    lightest = weights.min()
                if w > lightest:
                    k = int(weights.argmin())
                    pairs[k, 0], pairs[k, 1] = i, j
                    weights[k] = w
                    lightest = weights.min()
    return count


@kernel
def overlap_length(line, ux, uy, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Length that segment a-b shares with `line` when projected on its direction (ux, uy)."""
    s = ux * line[X1] + uy * line[Y1]
    ta, tb = ux * ax + uy * ay, ux * bx + uy * by
    return min(max(ta, tb), s + line[LENGTH]) - max(min(ta, tb), s)


@kernel
def add_vote(slots, cells, used, cell, half, w, tx, ty):  # type: ignore[no-untyped-def]
    """Add a vote for a translation to its cell; returns the number of cells in use."""
    n = slots.shape[0]
    gx, gy = math.floor((tx + half) / cell), math.floor((ty + half) / cell)
    if gx < 0 or gy < 0 or gx >= n or gy >= n:
        return used
    k = slots[gx, gy] - 1
    if k < 0:
        if used >= cells.shape[0]:
            return used
        k = used
        used += 1
        slots[gx, gy] = used
        cells[k, 0], cells[k, 1] = gx, gy
        cells[k, 2] = cells[k, 3] = cells[k, 4] = 0.0
    cells[k, 2] += w
    cells[k, 3] += w * tx
    cells[k, 4] += w * ty
    return used


@kernel
def vote_translations(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, phi, pairs, count, cell, half, slots, cells
):
    """Vote for translations: two non-parallel constraints meet in one point; same edges coincide.

    slots: (n, n) zeros, becomes one more than each voted cell's row in `cells`: its place in the
    grid (x, y), the votes' weight and their weighted x and y. Returns the number of those rows.
    """
    c, s = math.cos(phi), math.sin(phi)
    offs = np.empty(count)
    ux, uy = np.empty(count), np.empty(count)
    spans = np.empty((count, 5))
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        ux[p], uy[p] = math.cos(ref[i, THETA]), math.sin(ref[i, THETA])
        ax, ay = c * cur[j, X1] - s * cur[j, Y1], s * cur[j, X1] + c * cur[j, Y1]
        bx, by = c * cur[j, X2] - s * cur[j, Y2], s * cur[j, X2] + c * cur[j, Y2]
        offs[p] = ref[i, OFFSET] - 0.5 * (ux[p] * (ay + by) - uy[p] * (ax + bx))
        # Along the reference line: where it lies, where the current one does, what they must share.
        spans[p, 0] = ux[p] * ref[i, X1] + uy[p] * ref[i, Y1]
        spans[p, 1] = spans[p, 0] + ref[i, LENGTH]
        ta, tb = ux[p] * ax + uy[p] * ay, ux[p] * bx + uy[p] * by
        spans[p, 2], spans[p, 3] = min(ta, tb), max(ta, tb)
        spans[p, 4] = 0.3 * min(ref[i, LENGTH], cur[j, LENGTH])
    used = 0
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        wp = min(ref[i, LENGTH], cur[j, LENGTH], LONG_ENOUGH)
        for side in range(2):
            if ref_ends[i, side] == EDGE and cur_ends[j, side] == EDGE:
                ex = c * cur_edges[j, side, 0] - s * cur_edges[j, side, 1]
                ey = s * cur_edges[j, side, 0] + c * cur_edges[j, side, 1]
                tx, ty = ref_edges[i, side, 0] - ex, ref_edges[i, side, 1] - ey
                w = 0.7 * min(wp, 1.0)
                used = add_vote(slots, cells, used, cell, half, w, tx, ty)
        for q in range(p + 1, count):
            sine = ux[p] * uy[q] - uy[p] * ux[q]
            if abs(sine) < 0.3 or i == pairs[q, 0] or j == pairs[q, 1]:
                continue
            tx = (offs[p] * ux[q] - offs[q] * ux[p]) / sine
            ty = (offs[p] * uy[q] - offs[q] * uy[p]) / sine
            if abs(tx) > half or abs(ty) > half:
                continue
            along = ux[p] * tx + uy[p] * ty
            op = min(spans[p, 1], spans[p, 3] + along) - max(spans[p, 0], spans[p, 2] + along)
            if op < spans[p, 4]:
                continue
            along = ux[q] * tx + uy[q] * ty
            oq = min(spans[q, 1], spans[q, 3] + along) - max(spans[q, 0], spans[q, 2] + along)
            if oq < spans[q, 4]:
                continue
            w = math.sqrt(min(op, LONG_ENOUGH) * min(oq, LONG_ENOUGH))
            used = add_vote(slots, cells, used, cell, half, w, tx, ty)
    return used


@kernel
def vote_peaks(slots, cells, used, most, out):  # type: ignore[no-untyped-def]
    """The best cells (3 x 3 sums, non-maxima suppressed) as rows x, y, votes; clears the slots."""
    n = slots.shape[0]
    sums = np.empty((used, 3))
    for t in range(used):
        gx0, gy0 = int(cells[t, 0]), int(cells[t, 1])
        sums[t] = 0.0
        for gx in range(max(gx0 - 1, 0), min(gx0 + 2, n)):
            for gy in range(max(gy0 - 1, 0), min(gy0 + 2, n)):
                k = slots[gx, gy] - 1
                if k >= 0:
                    for a in range(3):
                        sums[t, a] += cells[k, 2 + a]
    count = 0
    while count < most:
        top, where = 0.0, -1
        for t in range(used):
            if sums[t, 0] > top:
                top, where = sums[t, 0], t
        if where < 0:
            break
        out[count, 0], out[count, 1] = sums[where, 1] / top, sums[where, 2] / top
        out[count, 2] = top
        count += 1
        gx0, gy0 = cells[where, 0], cells[where, 1]
        for t in range(used):
            if abs(cells[t, 0] - gx0) <= 1 and abs(cells[t, 1] - gy0) <= 1:
                sums[t, 0] = -1.0
    for t in range(used):
        slots[int(cells[t, 0]), int(cells[t, 1])] = 0
    return count


@kernel
def explained_length(ref, cur, phi, pairs, count, tx, ty, reach, taken):  # type: ignore[no-untyped-def]
    """Length of current lines that lie on reference lines, nearer counts more, each once."""
    c, s = math.cos(phi), math.sin(phi)
    taken[:] = 0.0
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        ux, uy = math.cos(ref[i, THETA]), math.sin(ref[i, THETA])
        ax, ay = c * cur[j, X1] - s * cur[j, Y1] + tx, s * cur[j, X1] + c * cur[j, Y1] + ty
        bx, by = c * cur[j, X2] - s * cur[j, Y2] + tx, s * cur[j, X2] + c * cur[j, Y2] + ty
        distance = abs(0.5 * (ux * (ay + by) - uy * (ax + bx)) - ref[i, OFFSET])
        if distance > reach:
            continue
        shared = overlap_length(ref[i], ux, uy, ax, ay, bx, by)
        if shared > 0.0:
            taken[j] = max(taken[j], shared * (1.0 - 0.5 * distance / reach))
    return taken.sum()


@kernel
def lying_pairs(ref, cur, pose, angle_gate, distance_gate, least_overlap):  # type: ignore[no-untyped-def]
    """Rows i, j, overlap, distance, angle of the lines that lie on each other under `pose`."""
    out = np.empty((ref.shape[0] * cur.shape[0], 5))
    count = 0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(ref.shape[0]):
        ux, uy = math.cos(ref[i, THETA]), math.sin(ref[i, THETA])
        for j in range(cur.shape[0]):
            angle = wrap_angle(cur[j, THETA] + pose[2] - ref[i, THETA])
            if abs(angle) > angle_gate:
                continue
            ax = c * cur[j, X1] - s * cur[j, Y1] + pose[0]
            ay = s * cur[j, X1] + c * cur[j, Y1] + pose[1]
            bx = c * cur[j, X2] - s * cur[j, Y2] + pose[0]
            by = s * cur[j, X2] + c * cur[j, Y2] + pose[1]
            distance = abs(0.5 * (ux * (ay + by) - uy * (ax + bx)) - ref[i, OFFSET])
            shared = overlap_length(ref[i], ux, uy, ax, ay, bx, by)
            if distance > distance_gate or shared < least_overlap:
                continue
            out[count, 0], out[count, 1], out[count, 2] = i, j, shared
            out[count, 3], out[count, 4] = distance, angle
            count += 1
    return out[:count]


@kernel
def propose(  # type: ignore[no-untyped-def]
    ref,
    ref_ends,
    ref_edges,
    cur,
    cur_ends,
    cur_edges,
    rotations,
    cells,
    least_share,
    pair_limit,
    cell,
    half,
    reach,
):
    """Steps 1 to 3: rows x, y, theta, explained length, votes; best explained first."""
    phis = rotation_peaks(ref, cur, rotations, least_share, math.radians(3.0))
    table = np.empty((phis.shape[0] * cells, 5))
    n = int(2.0 * half / cell) + 1
    slots = np.zeros((n, n), dtype=np.int32)
    pairs = np.empty((pair_limit, 2), dtype=np.int64)
    voted = np.empty((min(n * n, MOST_CELLS), 5))
    peaks = np.empty((cells, 3))
    taken = np.empty(cur.shape[0])
    rows = 0
    for f in range(phis.shape[0]):
        phi = phis[f]
        count = compatible_pairs(ref, cur, phi, math.radians(6.0), pair_limit, pairs)
        used = vote_translations(
            ref, ref_ends, ref_edges, cur, cur_ends, cur_edges,
            phi, pairs, count, cell, half, slots, voted,
        )  # fmt: skip
        found = vote_peaks(slots, voted, used, cells, peaks)
        for k in range(found):
            tx, ty = peaks[k, 0], peaks[k, 1]
            table[rows, 0], table[rows, 1], table[rows, 2] = tx, ty, phi
            table[rows, 3] = explained_length(ref, cur, phi, pairs, count, tx, ty, reach, taken)
            table[rows, 4] = peaks[k, 2]
            rows += 1
    order = np.argsort(-table[:rows, 3], kind="mergesort")
    return table[:rows][order]
