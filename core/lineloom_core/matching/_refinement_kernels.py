"""Numba kernels of the matcher's step 4: Gauss-Newton on lines, directions and corners.

Slow twins: tests/core/matching/slow_twins.py.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

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
from lineloom_core.matching._proposal_kernels import wrap_angle


@njit(cache=True)
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


@njit(cache=True)
def accumulate_lines(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, pose, angle_gate, distance_gate, H, g
):
    """Add the normal equations of point-to-line, angle and end-point residuals at `pose`.

    Residuals of current lines against reference lines, parameters (x, y, theta) of
    T_reference_current. Returns the overlapped length.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    tx, ty = pose[0], pose[1]
    total = 0.0
    for j in range(cur.shape[0]):
        ax, ay = c * cur[j, X1] - s * cur[j, Y1] + tx, s * cur[j, X1] + c * cur[j, Y1] + ty
        bx, by = c * cur[j, X2] - s * cur[j, Y2] + tx, s * cur[j, X2] + c * cur[j, Y2] + ty
        theta = cur[j, THETA] + pose[2]
        for i in range(ref.shape[0]):
            da = wrap_angle(ref[i, THETA] - theta)
            if abs(da) > angle_gate:
                continue
            ux, uy = math.cos(ref[i, THETA]), math.sin(ref[i, THETA])
            nx, ny = -uy, ux
            ea, eb = nx * ax + ny * ay - ref[i, OFFSET], nx * bx + ny * by - ref[i, OFFSET]
            # Clip the current segment to the reference one: only the shared part is evidence.
            s1 = ux * ref[i, X1] + uy * ref[i, Y1]
            s2 = s1 + ref[i, LENGTH]
            ta, tb = ux * ax + uy * ay, ux * bx + uy * by
            if tb - ta < 1e-6:
                continue
            lo, hi = max(ta, s1), min(tb, s2)
            shared = hi - lo
            if shared < 0.3 * min(ref[i, LENGTH], cur[j, LENGTH]):
                continue
            slope = (eb - ea) / (tb - ta)
            middle = 0.5 * (lo + hi)
            e = ea + slope * (middle - ta)
            if abs(e) > distance_gate:
                continue
            total += shared
            # The middle of the shared part, across the line.
            px, py = (
                ux * middle + nx * (ref[i, OFFSET] + e),
                uy * middle + ny * (ref[i, OFFSET] + e),
            )
            mr = middle - 0.5 * (s1 + s2)
            mc = middle - 0.5 * (ta + tb)
            var = (ref[i, VAR_OFFSET] + cur[j, VAR_OFFSET] + 4e-5
                   + ref[i, VAR_THETA] * mr * mr + cur[j, VAR_THETA] * mc * mc)  # fmt: skip
            sigma = math.sqrt(var)
            w = 1.0 / var
            if abs(e) > 3.0 * sigma:
                w *= 3.0 * sigma / abs(e)
            j2 = -nx * (py - ty) + ny * (px - tx)
            H[0, 0] += w * nx * nx
            H[0, 1] += w * nx * ny
            H[0, 2] += w * nx * j2
            H[1, 1] += w * ny * ny
            H[1, 2] += w * ny * j2
            H[2, 2] += w * j2 * j2
            g[0] -= w * nx * e
            g[1] -= w * ny * e
            g[2] -= w * j2 * e
            # Direction.
            var = ref[i, VAR_THETA] + cur[j, VAR_THETA] + 1e-5
            w = 1.0 / var
            if da * da > 9.0 * var:
                w *= 3.0 * math.sqrt(var) / abs(da)
            H[2, 2] += w
            g[2] += w * da
            # End points: a corner seen in both scans fixes the slide along the line.
            for side in range(2):
                if ref_ends[i, side] != EDGE or cur_ends[j, side] != EDGE:
                    continue
                qx = c * cur_edges[j, side, 0] - s * cur_edges[j, side, 1]
                qy = s * cur_edges[j, side, 0] + c * cur_edges[j, side, 1]
                e = ux * (qx + tx - ref_edges[i, side, 0]) + uy * (qy + ty - ref_edges[i, side, 1])
                if abs(e) > distance_gate:
                    continue
                var = 0.0025
                w = 1.0 / var
                if e * e > 4.0 * var:
                    w *= 2.0 * math.sqrt(var) / abs(e)
                j2 = -ux * qy + uy * qx
                H[0, 0] += w * ux * ux
                H[0, 1] += w * ux * uy
                H[0, 2] += w * ux * j2
                H[1, 1] += w * uy * uy
                H[1, 2] += w * uy * j2
                H[2, 2] += w * j2 * j2
                g[0] -= w * ux * e
                g[1] -= w * uy * e
                g[2] -= w * j2 * e
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    return total


@njit(cache=True)
def refine(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, pose, H, iterations
):
    """Step 4: Gauss-Newton on lines, shrinking gates. Moves `pose`, fills H; returns overlap."""
    angle_gate, distance_gate = math.radians(7.0), 0.25
    total = 0.0
    g = np.zeros(3)
    for it in range(iterations + 1):
        H[:] = 0.0
        g[:] = 0.0
        total = accumulate_lines(
            ref, ref_ends, ref_edges, cur, cur_ends, cur_edges,
            pose, angle_gate, distance_gate, H, g,
        )  # fmt: skip
        if it == iterations or total == 0.0:
            break
        A = H.copy()
        # A weak prior keeps what no line constrains where the hypothesis put it.
        A[0, 0] += 25.0
        A[1, 1] += 25.0
        A[2, 2] += 100.0
        d = solve3(A, g)
        pose[0] += d[0]
        pose[1] += d[1]
        pose[2] = wrap_angle(pose[2] + d[2])
        angle_gate = max(angle_gate * 0.7, math.radians(3.0))
        distance_gate = max(distance_gate * 0.7, 0.12)
    return total
