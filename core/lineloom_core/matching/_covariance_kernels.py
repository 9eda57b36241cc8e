"""Numba kernels of the pose's covariance: what the noise of two scans makes of the estimate.

Slow twins: tests/core/matching/covariance_twins.py.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._kernels import (
    EDGE,
    FIRST,
    LAST,
    LENGTH,
    OFFSET,
    THETA,
    X1,
    X2,
    Y1,
    Y2,
)
from lineloom_core.kernels import kernel
from lineloom_core.matching._circle_match_kernels import accumulate_centre_noise
from lineloom_core.matching._refinement_kernels import (
    EDGE_VARIANCE,
    directions,
    huber,
    line_residual,
    lines_near,
    weights_of,
)

LEAST_NOISE = 1e-6
"""Variance [m^2] under which no lidar is believed."""
PRIOR_COUNT = 4.0
"""Points that the scan's own noise counts for beside a line's."""
UNSEEN = (0.01, 0.01, 1.0)
"""Information [1/m^2, 1/rad^2] of what nothing observes: 10 m and 1 rad."""
TRUSTED_COUNT = 10.0
"""Residuals that agree with their noise and are counted beside the measured ones."""
FAR_OUT = 0.065
"""Points farther off their line [m] are not noise of it (the split threshold)."""


@kernel
def line_noise(lines, points, beams, turn):  # type: ignore[no-untyped-def]
    """Variances of each line's direction and of its offset at its centroid: (n, 2) [rad^2, m^2].

    The noise is that of the line's own
    points, drawn a little towards that of the whole scan: a line of five points may lie on them by
    chance. Range noise tells less across a wall that is seen at a grazing angle, so lines differ.
    turn: beams of the sweep.
    """
    n = lines.shape[0]
    line_of = np.full(turn, -1, dtype=np.int64)
    for i in range(n):
        for b in range(int(lines[i, FIRST]), min(int(lines[i, LAST]) + 1, turn)):
            line_of[b] = i
    ux, uy = np.cos(lines[:, THETA]), np.sin(lines[:, THETA])
    squares, count = np.zeros(n), np.zeros(n)
    first, second = np.zeros(n), np.zeros(n)
    for k in range(points.shape[0]):
        i = line_of[beams[k]]
        if i < 0:
            continue
        d = ux[i] * points[k, 1] - uy[i] * points[k, 0] - lines[i, OFFSET]
        if abs(d) > FAR_OUT:
            continue
        t = ux[i] * points[k, 0] + uy[i] * points[k, 1]
        count[i] += 1.0
        squares[i] += d * d
        first[i] += t
        second[i] += t * t
    free = total = 0.0
    for i in range(n):
        if count[i] > 2.0:
            free += count[i] - 2.0
            total += squares[i]
    common = max(total / free, LEAST_NOISE) if free > 0.0 else 2.25e-4
    out = np.empty((n, 2))
    for i in range(n):
        m = max(count[i], 3.0)
        var = (squares[i] + PRIOR_COUNT * common) / (m - 2.0 + PRIOR_COUNT)
        along = second[i] - first[i] * first[i] / m if count[i] > 2.0 else 0.0
        least = m * lines[i, LENGTH] ** 2 / 24.0
        out[i, 0] = var / max(along, least)
        out[i, 1] = var / m
    return out


@kernel
def corner_partner(lines, ends, edges, i, side):  # type: ignore[no-untyped-def]
    """The line that makes an angle edge with line i, or -1: a jump edge."""
    x, y = edges[i, side, 0], edges[i, side, 1]
    for k in range(lines.shape[0]):
        if k == i or ends[k, 1 - side] != EDGE:
            continue
        if abs(edges[k, 1 - side, 0] - x) < 1e-6 and abs(edges[k, 1 - side, 1] - y) < 1e-6:
            return k
    return -1


@kernel
def edge_noise(lines, ends, edges, spacing, i, side, sign, gain, G, M):  # type: ignore[no-untyped-def]
    """Add what the noise of one edge point, taken along its line, does through `gain` (3,).

    An angle edge moves with the line it meets (and that line's error is in the sum already, so it
    adds to the same row of G, (n, 3, 2)). A jump edge lies anywhere within one beam's spacing from
    the last point: uniform, second moment a third of the spacing squared. M: (3, 3).
    """
    k = corner_partner(lines, ends, edges, i, side)
    if k >= 0:
        x, y = edges[i, side, 0], edges[i, side, 1]
        d = lines[k, THETA] - lines[i, THETA]
        sine, cosine = math.sin(d), math.cos(d)
        for q in range(2):
            p = k if q == 0 else i
            # Corner on both lines: along i it shifts by (cos d * off_i - off_k) / sin d.
            share = (-1.0 if q == 0 else cosine) / sine
            u, v = math.cos(lines[p, THETA]), math.sin(lines[p, THETA])
            arm = u * (x - 0.5 * (lines[p, X1] + lines[p, X2])) + v * (
                y - 0.5 * (lines[p, Y1] + lines[p, Y2])
            )
            for a in range(3):
                G[p, a, 0] += sign * share * gain[a] * arm
                G[p, a, 1] += sign * share * gain[a]
        return
    x, y = edges[i, side, 0], edges[i, side, 1]
    wide = min((x * x + y * y) * spacing / max(abs(lines[i, OFFSET]), 1e-3), 0.5)
    for a in range(3):
        for b in range(3):
            M[a, b] += gain[a] * gain[b] * wide * wide / 3.0


@kernel
def accumulate_noise(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, ref_noise, ref_spacing,
    cur, cur_ends, cur_edges, cur_noise, cur_spacing,
    pose, angle_gate, distance_gate, H, M,
):  # fmt: skip
    """Add to H = J'WJ of the refinement at `pose` and to M = J'W S W J, S of what was measured.

    The estimate's error is H^-1 J'W e: linear in the errors of the lines' directions and offsets.
    One line speaks in several residuals (across, direction, corners, split walls), so its gain is
    summed first, and then squared: residuals of one line are not independent. Returns the sum of
    the squared normalised residuals and their number.
    """
    Gr = np.zeros((ref.shape[0], 3, 2))
    Gc = np.zeros((cur.shape[0], 3, 2))
    gain = np.empty(3)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    tx, ty = pose[0], pose[1]
    squares = used = 0.0
    along = directions(ref)
    pairs = np.empty((ref.shape[0] * cur.shape[0], 2), dtype=np.int64)
    for p in range(lines_near(ref, along, cur, pose, angle_gate, pairs)):
        i, j = pairs[p, 0], pairs[p, 1]
        ux, uy = along[i, 0], along[i, 1]
        shared, e, da, px, py, mr, mc = line_residual(
            ref[i], ux, uy, cur[j], c, s, pose, angle_gate, distance_gate
        )
        if shared <= 0.0:
            continue
        nx, ny = -uy, ux
        var, var_angle = weights_of(ref[i], cur[j], mr, mc)
        w = huber(e, var, 3.0)
        J = (nx, ny, -nx * (py - ty) + ny * (px - tx))
        for a in range(3):
            gain[a] = w * J[a]
            for b in range(3):
                H[a, b] += w * J[a] * J[b]
            Gr[i, a, 0] -= gain[a] * mr
            Gr[i, a, 1] -= gain[a]
            Gc[j, a, 0] += gain[a] * mc
            Gc[j, a, 1] += gain[a]
        true = (ref_noise[i, 1] + cur_noise[j, 1]
                + ref_noise[i, 0] * mr * mr + cur_noise[j, 0] * mc * mc)  # fmt: skip
        squares += min(e * e / true, 9.0)
        used += 1.0
        w = huber(da, var_angle, 3.0)
        H[2, 2] += w
        Gr[i, 2, 0] -= w
        Gc[j, 2, 0] += w
        squares += min(da * da / (ref_noise[i, 0] + cur_noise[j, 0]), 9.0)
        used += 1.0
        for side in range(2):
            if ref_ends[i, side] != EDGE or cur_ends[j, side] != EDGE:
                continue
            qx = c * cur_edges[j, side, 0] - s * cur_edges[j, side, 1]
            qy = s * cur_edges[j, side, 0] + c * cur_edges[j, side, 1]
            e = ux * (qx + tx - ref_edges[i, side, 0]) + uy * (qy + ty - ref_edges[i, side, 1])
            if abs(e) > distance_gate:
                continue
            w = huber(e, EDGE_VARIANCE, 2.0)
            J = (ux, uy, -ux * qy + uy * qx)
            for a in range(3):
                gain[a] = w * J[a]
                for b in range(3):
                    H[a, b] += w * J[a] * J[b]
            edge_noise(ref, ref_ends, ref_edges, ref_spacing, i, side, -1.0, gain, Gr, M)
            edge_noise(cur, cur_ends, cur_edges, cur_spacing, j, side, 1.0, gain, Gc, M)
    add_squares(Gr, ref_noise, M)
    add_squares(Gc, cur_noise, M)
    return squares, used


@kernel
def add_squares(G, noise, M):  # type: ignore[no-untyped-def]
    """M += sum over lines of G diag(noise) G'."""
    for i in range(G.shape[0]):
        for a in range(3):
            for b in range(3):
                for p in range(2):
                    M[a, b] += G[i, a, p] * G[i, b, p] * noise[i, p]


@kernel
def scan_noise(ref, cur, pose, angle_gate, distance_gate, H, M):  # type: ignore[no-untyped-def]
    """`accumulate_noise` with the noise that the lines' own points show, and that of circles."""
    ref_noise = line_noise(ref.lines, ref.points, ref.beams, ref.ranges.shape[0])
    cur_noise = line_noise(cur.lines, cur.points, cur.beams, cur.ranges.shape[0])
    squares, used = accumulate_noise(
        ref.lines, ref.ends, ref.edges, ref_noise, ref.angle_increment,
        cur.lines, cur.ends, cur.edges, cur_noise, cur.angle_increment,
        pose, angle_gate, distance_gate, H, M,
    )  # fmt: skip
    more, others = accumulate_centre_noise(ref.circles, cur.circles, pose, distance_gate, H, M)
    return squares + more, used + others


@kernel
def invert3(A, out):  # type: ignore[no-untyped-def]
    """out = A^-1 of a symmetric positive definite 3x3 matrix."""
    out[0, 0] = A[1, 1] * A[2, 2] - A[1, 2] * A[1, 2]
    out[0, 1] = A[0, 2] * A[1, 2] - A[0, 1] * A[2, 2]
    out[0, 2] = A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1]
    out[1, 1] = A[0, 0] * A[2, 2] - A[0, 2] * A[0, 2]
    out[1, 2] = A[0, 1] * A[0, 2] - A[0, 0] * A[1, 2]
    out[2, 2] = A[0, 0] * A[1, 1] - A[0, 1] * A[0, 1]
    det = A[0, 0] * out[0, 0] + A[0, 1] * out[0, 1] + A[0, 2] * out[0, 2]
    for a in range(3):
        for b in range(a, 3):
            out[a, b] /= det
            out[b, a] = out[a, b]


@kernel
def congruence(A, S, out):  # type: ignore[no-untyped-def]
    """out = A S A' of 3x3 matrices, A and S symmetric."""
    for a in range(3):
        for b in range(a, 3):
            total = 0.0
            for p in range(3):
                for q in range(3):
                    total += A[a, p] * S[p, q] * A[q, b]
            out[a, b] = total
            out[b, a] = total


@kernel
def forget_along(covariance, axis, sigma):  # type: ignore[no-untyped-def]
    """Make sigma [m] of what is known along `axis`, and keep what is known across and of the turn.

    The axis is that of the reference's walls and as noisy as they are, which is half of what is not
    known of the rotation: a slide of metres along it is one of millimetres across.
    """
    c, s = math.cos(axis), math.sin(axis)
    keep = np.eye(3)
    keep[0, 0] -= c * c
    keep[0, 1] -= c * s
    keep[1, 0] -= c * s
    keep[1, 1] -= s * s
    before = covariance.copy()
    congruence(keep, before, covariance)
    along, across = sigma * sigma, sigma * sigma * 0.5 * before[2, 2]
    covariance[0, 0] += along * c * c + across * s * s
    covariance[0, 1] += (along - across) * c * s
    covariance[1, 0] += (along - across) * c * s
    covariance[1, 1] += along * s * s + across * c * c


@kernel
def fill_covariance(  # type: ignore[no-untyped-def]
    ref, cur, pose, angle_gate, distance_gate, axis, sigma, always, covariance
):
    """The covariance of `pose`; see `covariance.py`.

    Along `axis` sigma [m] is claimed, `always` or where lines know less than that.
    """
    H, M, inverse = np.zeros((3, 3)), np.zeros((3, 3)), np.empty((3, 3))
    squares, used = scan_noise(ref, cur, pose, angle_gate, distance_gate, H, M)
    ratio = (squares + TRUSTED_COUNT) / (max(used - 3.0, 0.0) + TRUSTED_COUNT)
    for a in range(3):
        H[a, a] += UNSEEN[a]
        for b in range(3):
            M[a, b] *= ratio
        M[a, a] += UNSEEN[a]
    invert3(H, inverse)
    congruence(inverse, M, covariance)
    c, s = math.cos(axis), math.sin(axis)
    known = c * c * covariance[0, 0] + 2.0 * c * s * covariance[0, 1] + s * s * covariance[1, 1]
    if always or known > sigma * sigma:
        forget_along(covariance, axis, sigma)
