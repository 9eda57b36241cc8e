"""Numba kernels of the matcher's step 4: Gauss-Newton on lines, corners and centres of circles.

Slow twins: tests/core/matching/slow_twins.py.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._circle_kernels import CIRCLE_COLUMNS
from lineloom_core.features._kernels import (
    EDGE,
    LENGTH,
    OFFSET,
    THETA,
    VAR_OFFSET,
    VAR_THETA,
    X1,
    X2,
    Y1,
    Y2,
)
from lineloom_core.kernels import kernel
from lineloom_core.matching._circle_match_kernels import accumulate_circles
from lineloom_core.matching._proposal_kernels import wrap_angle

ACROSS_FLOOR, ANGLE_FLOOR = 4e-5, 1e-5
"""What no wall is straighter than: variances [m^2, rad^2] that keep long lines from ruling."""
EDGE_VARIANCE = 0.0025
"""Of a corner or a wall's end along the wall [m^2]."""
LAST_ANGLE_GATE, LAST_DISTANCE_GATE = math.radians(3.0), 0.12
"""What the gates shrink to."""
MOST_TURNED, MOST_MOVED = math.radians(8.0), 0.6
"""Farther than this [rad, m] no refinement takes a pose."""


@kernel
def solve3(A, b):  # type: ignore[no-untyped-def]
    """Solve a symmetric 3x3 system by Cramer's rule; zeros where singular."""
    c00 = A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]
    c01 = A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2]
    c02 = A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0]
    det = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    x = np.zeros(3)
    if abs(det) < 1e-12:
        return x
    x[0] = (b[0] * c00 + b[1] * (A[0, 2] * A[2, 1] - A[0, 1] * A[2, 2])
            + b[2] * (A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1])) / det  # fmt: skip
    x[1] = (b[0] * c01 + b[1] * (A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0])
            + b[2] * (A[0, 2] * A[1, 0] - A[0, 0] * A[1, 2])) / det  # fmt: skip
    x[2] = (b[0] * c02 + b[1] * (A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1])
            + b[2] * (A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0])) / det  # fmt: skip
    return x


@kernel
def huber(e, var, sigmas):  # type: ignore[no-untyped-def]
    """Weight of a residual of that variance, less beyond so many standard deviations."""
    if e * e <= sigmas * sigmas * var:
        return 1.0 / var
    return sigmas / (math.sqrt(var) * abs(e))


@kernel
def line_residual(ref, ux, uy, cur, c, s, pose, angle_gate, distance_gate):  # type: ignore[no-untyped-def]
    """One current line against one reference line at `pose`, c and s its cosine and sine.

    ux, uy: direction of the reference line.

    Only the part that both share is evidence. Returns its length (0 where the lines do not lie on
    each other), the distance across of its middle, the difference of directions, the middle of the
    current line's shared part (x, y), and how far from either line's own middle it lies.
    """
    da = wrap_angle(ref[THETA] - cur[THETA] - pose[2])
    if abs(da) > angle_gate:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ax, ay = c * cur[X1] - s * cur[Y1] + pose[0], s * cur[X1] + c * cur[Y1] + pose[1]
    bx, by = c * cur[X2] - s * cur[Y2] + pose[0], s * cur[X2] + c * cur[Y2] + pose[1]
    ea, eb = ux * ay - uy * ax - ref[OFFSET], ux * by - uy * bx - ref[OFFSET]
    s1 = ux * ref[X1] + uy * ref[Y1]
    s2 = s1 + ref[LENGTH]
    ta, tb = ux * ax + uy * ay, ux * bx + uy * by
    lo, hi = max(ta, s1), min(tb, s2)
    shared = hi - lo
    if tb - ta < 1e-6 or shared < 0.3 * min(ref[LENGTH], cur[LENGTH]):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    middle = 0.5 * (lo + hi)
    e = ea + (eb - ea) / (tb - ta) * (middle - ta)
    if abs(e) > distance_gate:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    px = ux * middle - uy * (ref[OFFSET] + e)
    py = uy * middle + ux * (ref[OFFSET] + e)
    return shared, e, da, px, py, middle - 0.5 * (s1 + s2), middle - 0.5 * (ta + tb)


@kernel
def weights_of(ref, cur, mr, mc):  # type: ignore[no-untyped-def]
    """The variances that the refinement weighs a pair of lines by: across, direction."""
    var = ref[VAR_OFFSET] + cur[VAR_OFFSET] + ACROSS_FLOOR
    var += ref[VAR_THETA] * mr * mr + cur[VAR_THETA] * mc * mc
    return var, ref[VAR_THETA] + cur[VAR_THETA] + ANGLE_FLOOR


@kernel
def add_residual(H, g, jx, jy, jt, w, e):  # type: ignore[no-untyped-def]
    """Add one weighted residual to the upper triangle of H and to g."""
    H[0, 0] += w * jx * jx
    H[0, 1] += w * jx * jy
    H[0, 2] += w * jx * jt
    H[1, 1] += w * jy * jy
    H[1, 2] += w * jy * jt
    H[2, 2] += w * jt * jt
    g[0] -= w * jx * e
    g[1] -= w * jy * e
    g[2] -= w * jt * e


@kernel
def directions(lines):  # type: ignore[no-untyped-def]
    """Cosine and sine of each line's direction, (n, 2)."""
    out = np.empty((lines.shape[0], 2))
    for i in range(lines.shape[0]):
        out[i, 0], out[i, 1] = math.cos(lines[i, THETA]), math.sin(lines[i, THETA])
    return out


@kernel
def lines_near(ref, ref_along, cur, pose, angle_reach, pairs):  # type: ignore[no-untyped-def]
    """Fill `pairs` (i, j) with the lines that may come to lie on each other near `pose`.

    Their directions differ by up to `angle_reach`, and the middle of one is not much farther from
    the other than turning by MOST_TURNED and moving by MOST_MOVED can make up for.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    count = 0
    for j in range(cur.shape[0]):
        mx, my = 0.5 * (cur[j, X1] + cur[j, X2]), 0.5 * (cur[j, Y1] + cur[j, Y2])
        rx, ry = c * mx - s * my, s * mx + c * my
        slack = MOST_MOVED + MOST_TURNED * math.sqrt(rx * rx + ry * ry)
        x, y = rx + pose[0], ry + pose[1]
        for i in range(ref.shape[0]):
            across = ref_along[i, 0] * y - ref_along[i, 1] * x - ref[i, OFFSET]
            if abs(across) > slack + MOST_TURNED * (0.5 * cur[j, LENGTH] + ref[i, LENGTH]):
                continue
            if abs(wrap_angle(ref[i, THETA] - cur[j, THETA] - pose[2])) <= angle_reach:
                pairs[count, 0], pairs[count, 1] = i, j
                count += 1
    return count


@kernel
def accumulate_lines(  # type: ignore[no-untyped-def]
    ref, ref_along, ref_ends, ref_edges, cur, cur_ends, cur_edges, pairs, count,
    pose, angle_gate, distance_gate, H, g,
):  # fmt: skip
    """Add the normal equations of point-to-line, angle and end-point residuals at `pose`.

    Residuals of current lines against reference lines, the first `count` of `pairs`, parameters
    (x, y, theta) of T_reference_current. Returns the overlapped length.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    tx, ty = pose[0], pose[1]
    total = 0.0
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        ux, uy = ref_along[i, 0], ref_along[i, 1]
        shared, e, da, px, py, mr, mc = line_residual(
            ref[i], ux, uy, cur[j], c, s, pose, angle_gate, distance_gate
        )
        if shared <= 0.0:
            continue
        total += shared
        nx, ny = -uy, ux
        # The middle of the shared part, across the line.
        var, var_angle = weights_of(ref[i], cur[j], mr, mc)
        j2 = -nx * (py - ty) + ny * (px - tx)
        add_residual(H, g, nx, ny, j2, huber(e, var, 3.0), e)
        # Direction.
        w = huber(da, var_angle, 3.0)
        H[2, 2] += w
        g[2] += w * da
        # End points: a corner seen in both scans fixes the slide along the line.
        for side in range(2):
            if ref_ends[i, side] != EDGE or cur_ends[j, side] != EDGE:
                continue
            qx = c * cur_edges[j, side, 0] - s * cur_edges[j, side, 1]
            qy = s * cur_edges[j, side, 0] + c * cur_edges[j, side, 1]
            e = ux * (qx + tx - ref_edges[i, side, 0]) + uy * (qy + ty - ref_edges[i, side, 1])
            if abs(e) <= distance_gate:
                w = huber(e, EDGE_VARIANCE, 2.0)
                add_residual(H, g, ux, uy, -ux * qy + uy * qx, w, e)
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    return total


@kernel
def refine_all(  # type: ignore[no-untyped-def]
    ref,
    ref_ends,
    ref_edges,
    ref_circles,
    cur,
    cur_ends,
    cur_edges,
    cur_circles,
    pose,
    H,
    iterations,
):
    """Step 4: Gauss-Newton, shrinking gates. Moves `pose`, fills H; returns the overlap.

    The overlap is in metres of line and of arc.
    """
    angle_gate, distance_gate = math.radians(7.0), 0.25
    total = 0.0
    g, A = np.zeros(3), np.empty((3, 3))
    along = directions(ref)
    pairs = np.empty((ref.shape[0] * cur.shape[0], 2), dtype=np.int64)
    count = lines_near(ref, along, cur, pose, angle_gate + MOST_TURNED, pairs)
    for it in range(iterations + 1):
        H[:] = 0.0
        g[:] = 0.0
        total = accumulate_lines(
            ref, along, ref_ends, ref_edges, cur, cur_ends, cur_edges, pairs, count,
            pose, angle_gate, distance_gate, H, g,
        )  # fmt: skip
        if ref_circles.shape[0] > 0 and cur_circles.shape[0] > 0:
            total += accumulate_circles(ref_circles, cur_circles, pose, distance_gate, H, g)
        if it == iterations or total == 0.0:
            break
        A[:] = H
        # A weak prior keeps what no line constrains where the hypothesis put it.
        A[0, 0] += 25.0
        A[1, 1] += 25.0
        A[2, 2] += 100.0
        d = solve3(A, g)
        pose[0] += d[0]
        pose[1] += d[1]
        pose[2] = wrap_angle(pose[2] + d[2])
        angle_gate = max(angle_gate * 0.7, LAST_ANGLE_GATE)
        distance_gate = max(distance_gate * 0.7, LAST_DISTANCE_GATE)
    return total


@kernel
def refine(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, pose, H, iterations
):
    """`refine_all` on lines alone."""
    none = np.empty((0, CIRCLE_COLUMNS))
    return refine_all(
        ref, ref_ends, ref_edges, none, cur, cur_ends, cur_edges, none, pose, H, iterations
    )
