"""Numba kernels of circles in the matcher: hypotheses from their relations, and their residuals.

Circles are rows as `ScanFeatures.circles` describes them. Slow twins:
tests/core/matching/circle_twins.py.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._circle_kernels import (
    ARC,
    CX,
    CY,
    RADIUS,
    SENSE,
    VAR_RADIUS,
    VAR_XX,
    VAR_XY,
    VAR_YY,
)
from lineloom_core.features._kernels import LENGTH, OFFSET, THETA
from lineloom_core.kernels import kernel
from lineloom_core.matching._proposal_kernels import (
    LONG_ENOUGH,
    compatible_pairs,
    explained_length,
    wrap_angle,
)

RADIUS_SLACK, RELATION_SLACK = 0.03, 0.06
"""How much radii, and distances between centres and lines, may differ beyond their noise [m]."""
CENTRE_FLOOR = 4e-5
"""Variance of a centre [m^2] that no fit undercuts: nothing is rounder."""
LEAST_APART = 0.4
"""Centres nearer to each other than this [m] name no direction."""
SAME_TURN = math.radians(3.0)


@kernel
def same_circle(p, q):  # type: ignore[no-untyped-def]
    """May two circles be one: seen from the same side, and of one radius?"""
    noise = 3.0 * math.sqrt(p[VAR_RADIUS] + q[VAR_RADIUS])
    return p[SENSE] == q[SENSE] and abs(p[RADIUS] - q[RADIUS]) < noise + RADIUS_SLACK


@kernel
def circle_pairs(ref, cur):  # type: ignore[no-untyped-def]
    """Rows (i, j) of circles that may be one."""
    out = np.empty((ref.shape[0] * cur.shape[0], 2), dtype=np.int64)
    count = 0
    for i in range(ref.shape[0]):
        for j in range(cur.shape[0]):
            if same_circle(ref[i], cur[j]):
                out[count, 0], out[count, 1] = i, j
                count += 1
    return out[:count]


@kernel
def arc_length(p, q):  # type: ignore[no-untyped-def]
    """Metres of wall that a pair of circles stands for, as a line's length does."""
    return min(p[RADIUS] * p[ARC], q[RADIUS] * q[ARC], LONG_ENOUGH)


@kernel
def related_turns(ref, ref_circles, cur, cur_circles, pairs, p, turns, weights):  # type: ignore[no-untyped-def]
    """The rotations that relations to one pair of circles name, with their weights; their count.

    Invariants: the distance of a centre to a line (signed: on its free side or behind) and that of
    two centres. Where both scans have the same one, its directions give the rotation.
    """
    i, j = pairs[p]
    count = 0
    for k in range(ref.shape[0]):
        u, v = math.cos(ref[k, THETA]), math.sin(ref[k, THETA])
        there = u * ref_circles[i, CY] - v * ref_circles[i, CX] - ref[k, OFFSET]
        for m in range(cur.shape[0]):
            a, b = math.cos(cur[m, THETA]), math.sin(cur[m, THETA])
            here = a * cur_circles[j, CY] - b * cur_circles[j, CX] - cur[m, OFFSET]
            if abs(there - here) < RELATION_SLACK and count < turns.shape[0]:
                turns[count] = wrap_angle(ref[k, THETA] - cur[m, THETA])
                weights[count] = min(ref[k, LENGTH], cur[m, LENGTH], LONG_ENOUGH)
                count += 1
    for q in range(pairs.shape[0]):
        k, m = pairs[q]
        if k == i or m == j:
            continue
        rx, ry = ref_circles[k, CX] - ref_circles[i, CX], ref_circles[k, CY] - ref_circles[i, CY]
        sx, sy = cur_circles[m, CX] - cur_circles[j, CX], cur_circles[m, CY] - cur_circles[j, CY]
        there, here = math.hypot(rx, ry), math.hypot(sx, sy)
        if min(there, here) < LEAST_APART or abs(there - here) > RELATION_SLACK:
            continue
        if count < turns.shape[0]:
            turns[count] = wrap_angle(math.atan2(ry, rx) - math.atan2(sy, sx))
            weights[count] = arc_length(ref_circles[k], cur_circles[m])
            count += 1
    return count


@kernel
def likely_turns(turns, weights, count, most, out):  # type: ignore[no-untyped-def]
    """The rotations that most weight agrees on to SAME_TURN, best first; their number."""
    left = weights[:count].copy()
    found = 0
    while found < most:
        best, where = 0.0, -1
        for k in range(count):
            if left[k] <= 0.0:
                continue
            total = 0.0
            for m in range(count):
                if left[m] > 0.0 and abs(wrap_angle(turns[m] - turns[k])) < SAME_TURN:
                    total += left[m]
            if total > best + 1e-9:
                best, where = total, k
        if where < 0:
            break
        mean = 0.0
        for m in range(count):
            d = wrap_angle(turns[m] - turns[where])
            if left[m] > 0.0 and abs(d) < SAME_TURN:
                mean += left[m] * d
                left[m] = 0.0
        out[found, 0], out[found, 1] = wrap_angle(turns[where] + mean / best), best
        found += 1
    return found


@kernel
def centres_explained(ref, cur, pairs, pose, reach, taken):  # type: ignore[no-untyped-def]
    """Metres of arc whose centres fall on each other, nearer counts more, each circle once."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    taken[:] = 0.0
    for p in range(pairs.shape[0]):
        i, j = pairs[p]
        dx = c * cur[j, CX] - s * cur[j, CY] + pose[0] - ref[i, CX]
        dy = s * cur[j, CX] + c * cur[j, CY] + pose[1] - ref[i, CY]
        d = math.hypot(dx, dy)
        if d < reach:
            taken[j] = max(taken[j], arc_length(ref[i], cur[j]) * (1.0 - 0.5 * d / reach))
    return taken.sum()


@kernel
def propose_circles(  # type: ignore[no-untyped-def]
    ref, ref_circles, cur, cur_circles, by_lines, per_pair, pair_limit, half, reach
):
    """Steps 1 to 3 with circles: rows as `propose` gives them, explained arcs added, best first.

    by_lines: what the lines proposed. To these come, for each pair of circles that may be one, the
    rotations that its relations name, with the translation that lays centre on centre. Where there
    is no relation at all, one rotation stands for all.
    """
    pairs = circle_pairs(ref_circles, cur_circles)
    if pairs.shape[0] == 0:
        return by_lines
    n = by_lines.shape[0]
    table = np.empty((n + pairs.shape[0] * per_pair, 5))
    table[:n] = by_lines
    rows = n
    most = ref.shape[0] * cur.shape[0] + pairs.shape[0]
    turns, weights = np.empty(most), np.empty(most)
    found = np.empty((per_pair, 2))
    for p in range(pairs.shape[0]):
        count = related_turns(ref, ref_circles, cur, cur_circles, pairs, p, turns, weights)
        likely = likely_turns(turns, weights, count, per_pair, found)
        if likely == 0:
            found[0, 0], found[0, 1] = 0.0, 0.0
            likely = 1
        i, j = pairs[p]
        for k in range(likely):
            c, s = math.cos(found[k, 0]), math.sin(found[k, 0])
            tx = ref_circles[i, CX] - c * cur_circles[j, CX] + s * cur_circles[j, CY]
            ty = ref_circles[i, CY] - s * cur_circles[j, CX] - c * cur_circles[j, CY]
            if max(abs(tx), abs(ty)) > half or is_there(table, n, rows, tx, ty, found[k, 0]):
                continue
            table[rows, 0], table[rows, 1], table[rows, 2] = tx, ty, found[k, 0]
            table[rows, 3], table[rows, 4] = 0.0, found[k, 1]
            rows += 1
    line_pairs = np.empty((pair_limit, 2), dtype=np.int64)
    lines_taken, circles_taken = np.empty(cur.shape[0]), np.empty(cur_circles.shape[0])
    for k in range(rows):
        row = table[k]
        if k >= n:
            count = compatible_pairs(ref, cur, row[2], math.radians(6.0), pair_limit, line_pairs)
            row[3] = explained_length(
                ref, cur, row[2], line_pairs, count, row[0], row[1], reach, lines_taken
            )
        row[3] += centres_explained(ref_circles, cur_circles, pairs, row, reach, circles_taken)
    return table[:rows][np.argsort(-table[:rows, 3], kind="mergesort")]


@kernel
def is_there(table, first, last, tx, ty, phi):  # type: ignore[no-untyped-def]
    """Has table[first:last] nearly this pose already?"""
    for k in range(first, last):
        near = math.hypot(table[k, 0] - tx, table[k, 1] - ty) < 0.1
        if near and abs(wrap_angle(table[k, 2] - phi)) < 0.03:
            return True
    return False


@kernel
def centre_residual(p, q, c, s, pose):  # type: ignore[no-untyped-def]
    """Centre of current circle q on that of reference circle p: e (x, y), S (xx, xy, yy) of it.

    c, s: cosine and sine of the pose's rotation. Then the current centre turned into the reference
    frame, from the current origin.
    """
    rx, ry = c * q[CX] - s * q[CY], s * q[CX] + c * q[CY]
    xx = p[VAR_XX] + c * c * q[VAR_XX] - 2.0 * c * s * q[VAR_XY] + s * s * q[VAR_YY]
    xy = p[VAR_XY] + c * s * (q[VAR_XX] - q[VAR_YY]) + (c * c - s * s) * q[VAR_XY]
    yy = p[VAR_YY] + s * s * q[VAR_XX] + 2.0 * c * s * q[VAR_XY] + c * c * q[VAR_YY]
    return rx + pose[0] - p[CX], ry + pose[1] - p[CY], xx, xy, yy, rx, ry


@kernel
def centre_weight(ex, ey, xx, xy, yy):  # type: ignore[no-untyped-def]
    """Weight matrix (xx, xy, yy) of a centre residual, less beyond 3 sigma; and e'We before."""
    det = xx * yy - xy * xy
    a, b, d = yy / det, -xy / det, xx / det
    square = a * ex * ex + 2.0 * b * ex * ey + d * ey * ey
    less = 3.0 / math.sqrt(square) if square > 9.0 else 1.0
    return a * less, b * less, d * less, square


@kernel
def accumulate_circles(ref, cur, pose, distance_gate, H, g):  # type: ignore[no-untyped-def]
    """Add the normal equations of centres on centres at `pose`; returns their metres of arc."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for j in range(cur.shape[0]):
        for i in range(ref.shape[0]):
            ex, ey, xx, xy, yy, rx, ry = centre_residual(ref[i], cur[j], c, s, pose)
            if math.hypot(ex, ey) > distance_gate or not same_circle(ref[i], cur[j]):
                continue
            a, b, d, _ = centre_weight(ex, ey, xx + CENTRE_FLOOR, xy, yy + CENTRE_FLOOR)
            total += arc_length(ref[i], cur[j])
            # J = [1 0 -ry; 0 1 rx]
            H[0, 0] += a
            H[0, 1] += b
            H[1, 1] += d
            H[0, 2] += -a * ry + b * rx
            H[1, 2] += -b * ry + d * rx
            H[2, 2] += a * ry * ry - 2.0 * b * rx * ry + d * rx * rx
            wx, wy = a * ex + b * ey, b * ex + d * ey
            g[0] -= wx
            g[1] -= wy
            g[2] -= -ry * wx + rx * wy
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    return total


@kernel
def accumulate_centre_noise(ref, cur, pose, distance_gate, H, M):  # type: ignore[no-untyped-def]
    """Add J'WJ and J'W S W J of centres on centres, S without the floor; squares, number."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    squares = used = 0.0
    for j in range(cur.shape[0]):
        for i in range(ref.shape[0]):
            ex, ey, xx, xy, yy, rx, ry = centre_residual(ref[i], cur[j], c, s, pose)
            if math.hypot(ex, ey) > distance_gate or not same_circle(ref[i], cur[j]):
                continue
            a, b, d, _ = centre_weight(ex, ey, xx + CENTRE_FLOOR, xy, yy + CENTRE_FLOOR)
            J = np.array([[1.0, 0.0, -ry], [0.0, 1.0, rx]])
            W = np.array([[a, b], [b, d]])
            S = np.array([[xx, xy], [xy, yy]])
            for p in range(3):
                for q in range(3):
                    for k in range(2):
                        for m in range(2):
                            H[p, q] += J[k, p] * W[k, m] * J[m, q]
                            for u in range(2):
                                for v in range(2):
                                    gain = J[k, p] * W[k, m] * S[m, u] * W[u, v]
                                    M[p, q] += gain * J[v, q]
            squares += min(centre_weight(ex, ey, xx, xy, yy)[3], 18.0)
            used += 2.0
    return squares, used
