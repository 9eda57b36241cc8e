"""Slow, obvious twins of `lineloom_core.matching._circle_match_kernels`."""

from __future__ import annotations

import itertools
import math

import numpy as np
from lineloom_core.features._circle_kernels import (
    ARC,
    RADIUS,
    SENSE,
    VAR_RADIUS,
    VAR_XX,
    VAR_XY,
    VAR_YY,
)
from lineloom_core.geometry import Pose, wrap
from numpy.typing import NDArray

from tests.core.matching import slow_twins as slow

Floats = NDArray[np.float64]
Turn = tuple[float, float]
"""Rotation and weight."""


def centre(circle: Floats) -> Floats:
    return circle[:2]


def spread(circle: Floats) -> Floats:
    """Covariance (2, 2) of the centre."""
    return circle[[VAR_XX, VAR_XY, VAR_XY, VAR_YY]].reshape(2, 2)


def alike(p: Floats, q: Floats) -> bool:
    slack = 3.0 * math.sqrt(p[VAR_RADIUS] + q[VAR_RADIUS]) + 0.03
    return bool(p[SENSE] == q[SENSE] and abs(p[RADIUS] - q[RADIUS]) < slack)


def pairs_of(ref: Floats, cur: Floats) -> list[tuple[int, int]]:
    return [
        (i, j)
        for i, j in itertools.product(range(len(ref)), range(len(cur)))
        if alike(ref[i], cur[j])
    ]


def metres(p: Floats, q: Floats) -> float:
    return float(min(p[RADIUS] * p[ARC], q[RADIUS] * q[ARC], slow.LONG_ENOUGH))


def turns(
    lines: tuple[Floats, Floats],
    circles: tuple[Floats, Floats],
    pairs: list[tuple[int, int]],
    p: int,
) -> list[Turn]:
    """Rotations named by equal distances of the pair's centres to lines, then to other centres."""
    (ref, cur), (ref_circles, cur_circles), (i, j) = lines, circles, pairs[p]
    found = []
    for a, b in itertools.product(ref, cur):
        there = float(slow.normal(a) @ (centre(ref_circles[i]) - slow.start(a)))
        here = float(slow.normal(b) @ (centre(cur_circles[j]) - slow.start(b)))
        if abs(there - here) < 0.06:
            found.append((wrap(slow.angle_of(a) - slow.angle_of(b)), slow.weight(a, b)))
    for k, m in pairs:
        way_there = centre(ref_circles[k]) - centre(ref_circles[i])
        way_here = centre(cur_circles[m]) - centre(cur_circles[j])
        far, also = float(np.linalg.norm(way_there)), float(np.linalg.norm(way_here))
        if k != i and m != j and min(far, also) >= 0.4 and abs(far - also) <= 0.06:
            turn = math.atan2(way_there[1], way_there[0]) - math.atan2(way_here[1], way_here[0])
            found.append((wrap(turn), metres(ref_circles[k], cur_circles[m])))
    return found


def likely(named: list[Turn], most: int) -> Floats:
    """Greedily: the rotation with most weight within 3 degrees, moved to the mean of these."""
    rows: list[Turn] = []
    left = list(named)
    while left and len(rows) < most:
        around = [[t for t in left if abs(wrap(t[0] - c[0])) < math.radians(3.0)] for c in left]
        weights = [round(sum(w for _, w in group), 8) for group in around]
        k = int(np.argmax(weights))
        group, total = around[k], sum(w for _, w in around[k])
        mean = sum(w * wrap(t - left[k][0]) for t, w in group) / total
        rows.append((wrap(left[k][0] + mean), total))
        left = [t for t in left if t not in group]
    return np.array(rows).reshape(-1, 2)


def explained(ref: Floats, cur: Floats, T: Pose, reach: float) -> float:
    best: dict[int, float] = {}
    for i, j in pairs_of(ref, cur):
        d = float(np.linalg.norm(T.transform(centre(cur[j])) - centre(ref[i])))
        if d < reach:
            best[j] = max(best.get(j, 0.0), metres(ref[i], cur[j]) * (1.0 - 0.5 * d / reach))
    return sum(best.values())


def normal_equations(
    ref: Floats, cur: Floats, pose: Floats, gate: float, floor: float
) -> tuple[Floats, Floats, Floats, float]:
    """H = J'WJ, g = -J'We, M = J'W S W J and metres, J by differences, W from S and the floor."""
    H, g, M, total = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3)), 0.0
    for i, j in pairs_of(ref, cur):

        def residual(x: Floats, i: int = i, j: int = j) -> Floats:
            off: Floats = Pose.from_array(x).transform(centre(cur[j])) - centre(ref[i])
            return off

        e = residual(pose)
        if np.linalg.norm(e) > gate:
            continue
        steps = 1e-6 * np.eye(3)
        J = np.column_stack([(residual(pose + h) - residual(pose - h)) / 2e-6 for h in steps])
        c, s = math.cos(pose[2]), math.sin(pose[2])
        R = np.array([[c, -s], [s, c]])
        S = spread(ref[i]) + R @ spread(cur[j]) @ R.T
        W = np.linalg.inv(S + floor * np.eye(2))
        W = W * min(1.0, 3.0 / max(math.sqrt(float(e @ W @ e)), 1e-12))
        H += J.T @ W @ J
        g -= J.T @ W @ e
        M += J.T @ W @ S @ W @ J
        total += metres(ref[i], cur[j])
    return H, g, M, total
