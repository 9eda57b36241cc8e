"""Slow, obvious twins of `lineloom_core.places._constellation_kernels`."""

from __future__ import annotations

import math
from collections import Counter
from itertools import permutations

import numpy as np
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.places import _constellation_kernels as fast
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

Floats = NDArray[np.float64]


def objects(points: Floats, gap: float, most: float) -> set[tuple[float, float]]:
    """Middles of the boxes around clusters that single linkage cuts at `gap`."""
    found = set()
    names = fcluster(linkage(points, "single"), gap, "distance")
    for name in np.unique(names):
        low, high = points[names == name].min(axis=0), points[names == name].max(axis=0)
        if np.count_nonzero(names == name) >= 2 and math.dist(low, high) < most:
            found.add((float(low[0] + high[0]) / 2.0, float(low[1] + high[1]) / 2.0))
    return found


def alike(a: Floats, b: Floats, turn: float) -> bool:
    if a[fast.KIND] != b[fast.KIND]:
        return False
    if a[fast.KIND] == fast.OBJECT:
        return True
    directions = [math.atan2(row[fast.SINE], row[fast.COSINE]) for row in (a, b)]
    off = angle_difference(directions[0], directions[1] + turn)
    return abs(off) < math.acos(fast.SAME_DIRECTION)


def votes(ref: Floats, cur: Floats, half: float) -> Counter[tuple[int, int, int]]:
    """Every pair of one against every ordered pair of the other."""
    cells: Counter[tuple[int, int, int]] = Counter()
    n = math.ceil(2.0 * half / fast.CELL)
    for i in range(len(ref)):
        for j in range(i + 1, len(ref)):
            a, b = ref[i], ref[j]
            apart = math.dist(a[:2], b[:2])
            for p, q in permutations(range(len(cur)), 2):
                c, d = cur[p], cur[q]
                other = math.dist(c[:2], d[:2])
                if not all(fast.NEAREST <= far <= fast.FARTHEST for far in (apart, other)):
                    continue
                if abs(apart - other) >= fast.SAME_DISTANCE:
                    continue
                turn = math.atan2(*(b - a)[1::-1]) - math.atan2(*(d - c)[1::-1])
                if not (alike(a, c, turn) and alike(b, d, turn)):
                    continue
                middle = Pose(0.0, 0.0, turn).transform(0.5 * (c[:2] + d[:2])[None, :])[0]
                x, y = np.floor((0.5 * (a[:2] + b[:2]) - middle + half) / fast.CELL).astype(int)
                if 0 <= x < n and 0 <= y < n:
                    angle = (turn + math.pi) % (2.0 * math.pi)
                    step = int(angle * fast.TURNS / (2.0 * math.pi)) % fast.TURNS
                    cells[step, int(x), int(y)] += 1
    return cells


def common(ref: Floats, cur: Floats, pose: Pose, gate: float) -> list[tuple[int, int]]:
    """Each current landmark with the nearest reference one that it may be."""
    pairs = []
    moved = pose.transform(cur[:, :2])
    for k, at in enumerate(moved):
        near = [
            (math.dist(ref[i, :2], at), i)
            for i in range(len(ref))
            if alike(ref[i], cur[k], pose.theta) and math.dist(ref[i, :2], at) < gate
        ]
        if near:
            pairs.append((min(near)[1], k))
    return pairs
