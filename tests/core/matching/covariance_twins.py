"""Slow, obvious twins of `lineloom_core.matching._covariance_kernels`.

What a line's error does to the estimate is found by moving the line and looking.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from lineloom_core.features import EDGE, ScanFeatures
from lineloom_core.features._kernels import (
    FIRST,
    LAST,
    LENGTH,
    OFFSET,
    THETA,
    VAR_OFFSET,
    VAR_THETA,
)
from lineloom_core.geometry import Pose
from lineloom_core.matching import _covariance_kernels as fast
from numpy.typing import NDArray

from tests.core.matching import slow_twins as slow

Floats = NDArray[np.float64]


def noise_of_lines(f: ScanFeatures) -> Floats:
    """Variances of direction and offset of every line, from the points on it."""
    offs, alongs = [], []
    for line in f.lines:
        own = f.points[(f.beams >= line[FIRST]) & (f.beams <= line[LAST])]
        later = f.lines[(f.lines[:, FIRST] > line[FIRST]) & (f.lines[:, FIRST] <= line[LAST])]
        assert len(later) == 0, "lines that share beams are not for this twin"
        off = (own - slow.start(line)) @ slow.normal(line)
        near = np.abs(off) <= fast.FAR_OUT
        offs.append(off[near])
        alongs.append(own[near] @ slow.direction(line))
    big = [o for o in offs if len(o) > 2]
    common = sum(float(o @ o) for o in big) / sum(len(o) - 2 for o in big)
    rows = []
    for line, off, along in zip(f.lines, offs, alongs, strict=True):
        n = max(len(off), 3)
        var = (float(off @ off) + fast.PRIOR_COUNT * common) / (n - 2 + fast.PRIOR_COUNT)
        spread = max(len(along) * float(np.var(along)), n * line[LENGTH] ** 2 / 24.0)
        rows.append([var / spread, var / n])
    return np.array(rows)


def moved(f: ScanFeatures, i: int, turn: float, off: float) -> ScanFeatures:
    """Line i turned about its middle and shifted to its left; its corners move with it."""
    line = f.lines[i].copy()
    middle = 0.5 * (slow.start(line) + slow.end(line))
    motion = Pose(0.0, 0.0, turn)
    shift = middle + off * slow.normal(line)
    line[:4] = (motion.transform(line[:4].reshape(2, 2) - middle) + shift).ravel()
    line[THETA] += turn
    line[OFFSET] = float(slow.normal(line) @ slow.start(line))
    lines, edges = f.lines.copy(), f.edges.copy()
    lines[i] = line
    for side in range(2):
        k = partner(f, i, side)
        if k is not None:
            normals = np.array([slow.normal(lines[i]), slow.normal(lines[k])])
            corner = np.linalg.solve(normals, [lines[i][OFFSET], lines[k][OFFSET]])
            edges[i, side] = edges[k, 1 - side] = corner
    return replace(f, lines=lines, edges=edges)


def partner(f: ScanFeatures, i: int, side: int) -> int | None:
    """The line that meets line i in an angle edge at that side."""
    for k in range(len(f)):
        same = np.abs(f.edges[k, 1 - side] - f.edges[i, side]).max() < 1e-6
        if k != i and f.ends[k, 1 - side] == EDGE and same:
            return k
    return None


def jump_noise(f: ScanFeatures, i: int, side: int) -> float:
    """Second moment of a wall's end: anywhere within one beam's spacing on the wall."""
    r = np.linalg.norm(f.edges[i, side])
    grazing = abs(f.lines[i, OFFSET]) / r
    return float(min(r * f.angle_increment / grazing, 0.5) ** 2) / 3.0


Gradient = Callable[[ScanFeatures, ScanFeatures], Floats]


def frozen(
    ref: ScanFeatures, cur: ScanFeatures, pose: Floats, gates: tuple[float, float]
) -> tuple[Gradient, Floats, Floats]:
    """J'W e as a function of the features, J and W held; H = J'WJ; J'W S W J of jump edges."""
    terms: list[tuple[Callable[[ScanFeatures, ScanFeatures], float], Floats]] = []
    H, M = np.zeros((3, 3)), np.zeros((3, 3))
    T = Pose.from_array(pose)

    def add(kind: str, j: int, i: int, side: int) -> Floats:
        function = evaluated(kind, j, i, side, T, ref, cur)
        J = np.array([_partial(kind, j, i, side, pose, a, ref, cur) for a in range(3)])
        e = function(ref, cur)
        var, sigmas = variance(kind, j, i, ref, cur, T)
        gain = slow._huber(e, var, sigmas) * J
        H[:] += np.outer(gain, J)
        terms.append((function, gain))
        return gain

    for j, i in lying(ref, cur, pose, gates):
        add("across", j, i, 0)
        add("turned", j, i, 0)
        for side in range(2):
            if not ref.ends[i, side] == EDGE == cur.ends[j, side]:
                continue
            if abs(evaluated("along", j, i, side, T, ref, cur)(ref, cur)) > gates[1]:
                continue
            gain = add("along", j, i, side)
            for f, k in ((ref, i), (cur, j)):
                if partner(f, k, side) is None:
                    M += jump_noise(f, k, side) * np.outer(gain, gain)
    return (lambda r, c: sum((f(r, c) * g for f, g in terms), np.zeros(3))), H, M


def lying(
    ref: ScanFeatures, cur: ScanFeatures, pose: Floats, gates: tuple[float, float]
) -> list[tuple[int, int]]:
    T, found = Pose.from_array(pose), []
    for j in range(len(cur)):
        for i in range(len(ref)):
            p, q = ref.lines[i], cur.lines[j]
            a, b = T.transform(q[:4].reshape(2, 2))
            turned = math.remainder(p[THETA] - q[THETA] - T.theta, math.tau)
            shared = slow.overlap(p, a, b)
            if abs(turned) > gates[0] or shared < 0.3 * min(slow.length(p), slow.length(q)):
                continue
            if abs(float(slow.normal(p) @ (shared_middle(p, a, b) - slow.start(p)))) <= gates[1]:
                found.append((j, i))
    return found


def shared_middle(p: Floats, a: Floats, b: Floats) -> Floats:
    """The point of a-b over the middle of what it shares with p."""
    u = slow.direction(p)
    ta, tb = float(u @ (a - slow.start(p))), float(u @ (b - slow.start(p)))
    middle = 0.5 * (max(ta, 0.0) + min(tb, slow.length(p)))
    found: Floats = a + (b - a) * (middle - ta) / (tb - ta)
    return found


def evaluated(
    kind: str, j: int, i: int, side: int, T: Pose, ref0: ScanFeatures, cur0: ScanFeatures
) -> Callable[[ScanFeatures, ScanFeatures], float]:
    """A residual as a function of the features, at T; measured where it was at first."""
    p0, q0 = ref0.lines[i], cur0.lines[j]
    at = shared_middle(p0, *T.transform(q0[:4].reshape(2, 2)))
    u0, n0 = slow.direction(p0), slow.normal(p0)

    def across(ref: ScanFeatures, cur: ScanFeatures) -> float:
        a, b = T.transform(cur.lines[j, :4].reshape(2, 2))
        s = float(u0 @ (at - a)) / float(u0 @ (b - a))
        start, end = ref.lines[i, :4].reshape(2, 2)
        r = float(u0 @ (at - start)) / float(u0 @ (end - start))
        return float(n0 @ (a + s * (b - a) - start - r * (end - start)))

    def turned(ref: ScanFeatures, cur: ScanFeatures) -> float:
        return math.remainder(cur.lines[j, THETA] + T.theta - ref.lines[i, THETA], math.tau)

    def along(ref: ScanFeatures, cur: ScanFeatures) -> float:
        return float(u0 @ (T.transform(cur.edges[j, side]) - ref.edges[i, side]))

    return {"across": across, "turned": turned, "along": along}[kind]


def _partial(
    kind: str, j: int, i: int, side: int, pose: Floats, a: int, ref: ScanFeatures, cur: ScanFeatures
) -> float:
    """Numeric derivative of a residual by x, y or theta, its point on the current line held."""
    T = Pose.from_array(pose)
    p, step = ref.lines[i], 1e-6 * np.eye(3)[a]
    back, forth = Pose.from_array(pose - step), Pose.from_array(pose + step)
    if kind == "turned":
        return float(a == 2)
    point = cur.edges[j, side]
    if kind == "across":
        point = T.inverse().transform(
            shared_middle(p, *T.transform(cur.lines[j, :4].reshape(2, 2)))
        )
    axis = slow.normal(p) if kind == "across" else slow.direction(p)
    return float(axis @ (forth.transform(point) - back.transform(point))) / 2e-6


def variance(
    kind: str, j: int, i: int, ref: ScanFeatures, cur: ScanFeatures, T: Pose
) -> tuple[float, float]:
    """The variance by which the refinement weighs a residual, and its Huber limit in sigmas."""
    p, q = ref.lines[i], cur.lines[j]
    if kind == "along":
        return 0.0025, 2.0
    if kind == "turned":
        return p[VAR_THETA] + q[VAR_THETA] + 1e-5, 3.0
    a, b = T.transform(q[:4].reshape(2, 2))
    at, u = shared_middle(p, a, b), slow.direction(p)
    arms = [float(u @ (at - 0.5 * (x + y))) for x, y in ((slow.start(p), slow.end(p)), (a, b))]
    var = p[VAR_OFFSET] + q[VAR_OFFSET] + 4e-5
    return var + p[VAR_THETA] * arms[0] ** 2 + q[VAR_THETA] * arms[1] ** 2, 3.0


def accumulate(
    ref: ScanFeatures,
    ref_noise: Floats,
    cur: ScanFeatures,
    cur_noise: Floats,
    pose: Floats,
    gates: tuple[float, float],
) -> tuple[Floats, Floats]:
    """H = J'WJ and M = J'W S W J: move each line by a little, see what becomes of J'W e."""
    gradient, H, M = frozen(ref, cur, pose, gates)
    h = 1e-6
    for f, noise in ((ref, ref_noise), (cur, cur_noise)):
        for i in range(len(f)):
            for motion, var in (((h, 0.0), noise[i, 0]), ((0.0, h), noise[i, 1])):
                there, back = moved(f, i, *motion), moved(f, i, -motion[0], -motion[1])
                if f is ref:
                    g = gradient(there, cur) - gradient(back, cur)
                else:
                    g = gradient(ref, there) - gradient(ref, back)
                M = M + var * np.outer(g, g) / (2 * h) ** 2
    return H, M
