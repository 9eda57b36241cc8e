"""Numba kernels of the edges' errors: cost, gradient and normal equations of a pose graph.

Slow twin: tests/core/graph/dense_twins.py.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel

_SMALL_RAD = 1e-4  # half an angle below which the series is exact to double precision


@kernel
def wrapped(angle):  # type: ignore[no-untyped-def]
    """The angle in (-pi, pi] [rad]."""
    turns = math.floor((math.pi - angle) / (2.0 * math.pi))
    return angle + 2.0 * math.pi * turns


@kernel
def edge_error(pose_a, pose_b, measured, e, J_a, J_b):  # type: ignore[no-untyped-def]
    """e = Log(measured^-1 T_a_b) and its exact derivatives by right perturbations of both poses.

    J_b is the inverse right Jacobian of SE(2) at e, I + ad(e) / 2 + c ad(e)^2 (Solà, Deray and
    Atchuthan 2018); J_a = -J_b Ad(T_b_a).
    """
    c, s = math.cos(pose_a[2]), math.sin(pose_a[2])
    dx, dy = pose_b[0] - pose_a[0], pose_b[1] - pose_a[1]
    x, y, turn = c * dx + s * dy, c * dy - s * dx, pose_b[2] - pose_a[2]
    c, s = math.cos(measured[2]), math.sin(measured[2])
    dx, dy = x - measured[0], y - measured[1]
    ex, ey, angle = c * dx + s * dy, c * dy - s * dx, wrapped(turn - measured[2])
    half = 0.5 * angle
    if abs(half) < _SMALL_RAD:
        a, k = 1.0 - half * half / 3.0, 1.0 / 12.0
    else:
        a = half / math.tan(half)
        k = (1.0 - a) / (angle * angle)
    e[0], e[1], e[2] = a * ex + half * ey, a * ey - half * ex, angle
    J_b[:] = 0.0
    J_b[0, 0] = J_b[1, 1] = a
    J_b[0, 1], J_b[1, 0] = -half, half
    J_b[0, 2] = 0.5 * e[1] + k * angle * e[0]
    J_b[1, 2] = k * angle * e[1] - 0.5 * e[0]
    J_b[2, 2] = 1.0
    c, s = math.cos(turn), math.sin(turn)
    back_x, back_y = -c * x - s * y, s * x - c * y  # T_b_a
    for r in range(3):
        J_a[r, 0] = -(J_b[r, 0] * c - J_b[r, 1] * s)
        J_a[r, 1] = -(J_b[r, 0] * s + J_b[r, 1] * c)
        J_a[r, 2] = -(J_b[r, 0] * back_y - J_b[r, 1] * back_x + J_b[r, 2])


@kernel
def linearise(  # type: ignore[no-untyped-def]
    poses, ends, measured, information, weights, cauchy,
    columns, slots, gradient, diagonal, below, whole,
):  # fmt: skip
    """Return the cost at `poses`; fill gradient (n, 3) and, where `whole`, the normal equations.

    cauchy: (m,) scale of each edge's Cauchy kernel, infinite for none. weights: (m,) factors on
    information. columns: (m, 2) of the ends, -1 for the one that is held; slots: of their block.
    """
    gradient[:] = 0.0
    if whole:
        diagonal[:] = 0.0
        below[:] = 0.0
    e, We = np.empty(3), np.empty(3)
    J_a, J_b = np.empty((3, 3)), np.empty((3, 3))
    WJ_a, WJ_b = np.empty((3, 3)), np.empty((3, 3))
    cost = 0.0
    for m in range(ends.shape[0]):
        edge_error(poses[ends[m, 0]], poses[ends[m, 1]], measured[m], e, J_a, J_b)
        W = information[m]
        for r in range(3):
            We[r] = W[r, 0] * e[0] + W[r, 1] * e[1] + W[r, 2] * e[2]
        chi2 = e[0] * We[0] + e[1] * We[1] + e[2] * We[2]
        weight = weights[m]
        if math.isinf(cauchy[m]):
            cost += 0.5 * weight * chi2
        else:
            k2 = cauchy[m] * cauchy[m]
            cost += 0.5 * k2 * math.log1p(weight * chi2 / k2)
            weight *= k2 / (k2 + weight * chi2)
        a, b = columns[m, 0], columns[m, 1]
        add_gradient(gradient, a, J_a, We, weight)
        add_gradient(gradient, b, J_b, We, weight)
        if whole:
            multiply(W, J_a, weight, WJ_a)
            multiply(W, J_b, weight, WJ_b)
            if a >= 0:
                add_turned_product(diagonal[a], J_a, WJ_a)
            if b >= 0:
                add_turned_product(diagonal[b], J_b, WJ_b)
            if slots[m] >= 0 and b > a:
                add_turned_product(below[slots[m]], J_b, WJ_a)
            elif slots[m] >= 0:
                add_turned_product(below[slots[m]], J_a, WJ_b)
    return cost


@kernel
def add_gradient(gradient, column, J, We, weight):  # type: ignore[no-untyped-def]
    """gradient[column] += weight J' We, unless the pose is held."""
    if column >= 0:
        for r in range(3):
            gradient[column, r] += weight * (J[0, r] * We[0] + J[1, r] * We[1] + J[2, r] * We[2])


@kernel
def multiply(W, J, weight, out):  # type: ignore[no-untyped-def]
    """out = weight W J."""
    for r in range(3):
        for c in range(3):
            out[r, c] = weight * (W[r, 0] * J[0, c] + W[r, 1] * J[1, c] + W[r, 2] * J[2, c])


@kernel
def add_turned_product(C, A, B):  # type: ignore[no-untyped-def]
    """C += A' B."""
    for r in range(3):
        for c in range(3):
            C[r, c] += A[0, r] * B[0, c] + A[1, r] * B[1, c] + A[2, r] * B[2, c]


@kernel
def move(poses, held, columns_of, steps):  # type: ignore[no-untyped-def]
    """poses <- poses Exp(steps) by the chart (x, y, theta), in place; returns the longest step."""
    longest = 0.0
    for i in range(poses.shape[0]):
        if i == held:
            continue
        dx, dy, turn = steps[columns_of[i], 0], steps[columns_of[i], 1], steps[columns_of[i], 2]
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        poses[i, 0] += c * dx - s * dy
        poses[i, 1] += s * dx + c * dy
        poses[i, 2] = wrapped(poses[i, 2] + turn)
        longest = max(longest, abs(dx), abs(dy), abs(turn))
    return longest
