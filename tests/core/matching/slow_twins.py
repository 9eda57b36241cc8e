"""Slow, obvious twins of `lineloom_core.matching._kernels`.

A line is taken as its two end points; what follows from them is computed anew.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
from lineloom_core.features import EDGE, ScanFeatures
from lineloom_core.features._kernels import VAR_OFFSET, VAR_THETA
from lineloom_core.geometry import Pose, wrap
from lineloom_core.matching._free_space_kernels import CONFLICT, MATCHED, OCCLUDED, OUTSIDE
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Sweep = tuple[Floats, float, float]
"""Ranges, angle_min, angle_increment."""

LONG_ENOUGH = 3.0


def start(line: Floats) -> Floats:
    return line[:2]


def end(line: Floats) -> Floats:
    return line[2:4]


def length(line: Floats) -> float:
    return math.dist(start(line), end(line))


def direction(line: Floats) -> Floats:
    unit: Floats = (end(line) - start(line)) / length(line)
    return unit


def normal(line: Floats) -> Floats:
    u = direction(line)
    return np.array([-u[1], u[0]])


def angle_of(line: Floats) -> float:
    u = direction(line)
    return math.atan2(u[1], u[0])


def weight(p: Floats, q: Floats) -> float:
    return min(length(p), length(q), LONG_ENOUGH)


def histogram(ref: Floats, cur: Floats) -> Floats:
    """Weights of direction differences; each is shared by the two bins whose centres are next."""
    h = np.zeros(360)
    for p, q in itertools.product(ref, cur):
        degrees = math.degrees(wrap(angle_of(p) - angle_of(q))) + 180.0
        for k in range(-1, 361):
            share = 1.0 - abs(degrees - (k + 0.5))
            if share > 0.0:
                h[k % 360] += share * weight(p, q)
    return h


def rotations(ref: Floats, cur: Floats, most: int, least_share: float, reach: float) -> Floats:
    """Peaks of the smoothed histogram, each moved to the mean of the differences around it."""
    h = histogram(ref, cur)
    smooth = sum(w * np.roll(h, s) for s, w in zip(range(-2, 3), (1, 2, 3, 2, 1), strict=True))
    smooth = np.asarray(smooth)
    best = smooth.max()
    peaks: list[float] = []
    while len(peaks) < most and smooth.max() >= least_share * best:
        k = int(np.argmax(smooth))
        smooth[np.arange(k - 4, k + 5) % 360] = -1.0
        centre = math.radians(k + 0.5 - 180.0)
        around = [
            (wrap(angle_of(p) - angle_of(q) - centre), weight(p, q) ** 2)
            for p, q in itertools.product(ref, cur)
        ]
        near = np.array([(d, w) for d, w in around if abs(d) < reach])
        if len(near):
            centre += float(np.average(near[:, 0], weights=near[:, 1]))
        peaks.append(wrap(centre))
    return np.array(peaks)


def compatible(
    ref: Floats, cur: Floats, phi: float, tolerance: float
) -> dict[tuple[int, int], float]:
    """Weight of every pair of lines whose directions agree."""
    return {
        (i, j): min(length(ref[i]), length(cur[j]))
        for i, j in itertools.product(range(len(ref)), range(len(cur)))
        if abs(wrap(angle_of(ref[i]) - angle_of(cur[j]) - phi)) <= tolerance
    }


def overlap(line: Floats, a: Floats, b: Floats) -> float:
    """Common length of a segment a-b, projected onto `line`, and `line`; negative: the gap."""
    u = direction(line)
    ta, tb = sorted([float(u @ (a - start(line))), float(u @ (b - start(line)))])
    return float(min(tb, length(line)) - max(ta, 0.0))


Vote = tuple[float, Floats]
"""Weight and translation."""


def votes(
    ref: ScanFeatures, cur: ScanFeatures, phi: float, pairs: list[tuple[int, int]]
) -> list[Vote]:
    """Every vote, pair by pair: its edges, then where it meets a later pair's constraint."""
    cast: list[Vote] = []
    for p, (i, j) in enumerate(pairs):
        for side in range(2):
            if ref.ends[i, side] == EDGE == cur.ends[j, side]:
                t = ref.edges[i, side] - Pose(0.0, 0.0, phi).transform(cur.edges[j, side])
                cast.append((0.7 * min(weight(ref.lines[i], cur.lines[j]), 1.0), t))
        for k, m in pairs[p + 1 :]:
            vote = meeting(ref.lines[[i, k]], cur.lines[[j, m]], phi)
            if i != k and j != m and vote is not None:
                cast.append(vote)
    return cast


def meeting(refs: Floats, curs: Floats, phi: float) -> Vote | None:
    """The translation that lays two current lines on two reference lines, if they overlap then."""
    rows = np.array([normal(line) for line in refs])
    if abs(np.linalg.det(rows)) < 0.3:
        return None
    moved = [Pose(0.0, 0.0, phi).transform(line[:4].reshape(2, 2)) for line in curs]
    apart = [rows[k] @ (start(refs[k]) - moved[k].mean(axis=0)) for k in range(2)]
    t = np.linalg.solve(rows, np.array(apart))
    shared = [overlap(refs[k], *(moved[k] + t)) for k in range(2)]
    if any(shared[k] < 0.3 * min(length(refs[k]), length(curs[k])) for k in range(2)):
        return None
    return math.sqrt(min(shared[0], LONG_ENOUGH) * min(shared[1], LONG_ENOUGH)), t


def vote_grid(
    cast: list[Vote], cell: float, half: float, n: int
) -> tuple[Floats, list[tuple[int, int]]]:
    """Sums of w, w x, w y by cell, and the cells in the order of their first votes."""
    grid = np.zeros((3, n, n))
    order: dict[tuple[int, int], None] = {}
    for w, t in cast:
        gx, gy = (math.floor(v) for v in (t + half) / cell)
        if 0 <= gx < n and 0 <= gy < n:
            grid[:, gx, gy] += [w, w * t[0], w * t[1]]
            order[gx, gy] = None
    return grid, list(order)


def best_cells(grid: Floats, cells: list[tuple[int, int]], most: int) -> Floats:
    """Greatest sums over the 3 x 3 cells about a cell with votes; peaks have no neighbours."""
    rows: list[tuple[float, ...]] = []
    around = {(x, y): grid[:, max(x - 1, 0) : x + 2, max(y - 1, 0) : y + 2] for x, y in cells}
    sums = {c: a.sum(axis=(1, 2)) for c, a in around.items()}
    while len(rows) < most and sums:
        x, y = max(sums, key=lambda c: round(float(sums[c][0]), 9))  # the first of equals
        total, sx, sy = sums[x, y]
        rows.append((sx / total, sy / total, total))
        sums = {c: s for c, s in sums.items() if max(abs(c[0] - x), abs(c[1] - y)) > 1}
    return np.array(rows).reshape(-1, 3)


def explained(
    ref: Floats, cur: Floats, pose: Pose, pairs: list[tuple[int, int]], reach: float
) -> float:
    best: dict[int, float] = {}
    for i, j in pairs:
        a, b = pose.transform(cur[j, :4].reshape(2, 2))
        distance = abs(float(normal(ref[i]) @ (0.5 * (a + b) - start(ref[i]))))
        if distance <= reach:
            value = max(overlap(ref[i], a, b), 0.0) * (1.0 - 0.5 * distance / reach)
            best[j] = max(best.get(j, 0.0), value)
    return sum(best.values())


Residual = tuple[Callable[[Floats], float], float]
"""A function of (x, y, theta), and its weight."""


def residuals(
    ref: ScanFeatures, cur: ScanFeatures, pose: Floats, angle_gate: float, distance_gate: float
) -> tuple[list[Residual], float]:
    """All residuals whose gates are open at `pose`, and the overlapped length."""
    T, found, total = Pose.from_array(pose), [], 0.0
    for c, r in itertools.product(range(len(cur)), range(len(ref))):
        p, q = ref.lines[r], cur.lines[c]
        turned = wrap(angle_of(p) - angle_of(q) - T.theta)
        a, b = T.transform(q[:4].reshape(2, 2))
        shared = overlap(p, a, b)
        if abs(turned) > angle_gate or shared < 0.3 * min(length(p), length(q)):
            continue
        u = direction(p)
        ta, tb, t1 = u @ a, u @ b, u @ start(p)
        middle = 0.5 * (max(ta, t1) + min(tb, t1 + length(p)))
        at = a + (b - a) * (middle - ta) / (tb - ta)
        e = float(normal(p) @ (at - start(p)))
        if abs(e) > distance_gate:
            continue
        total += shared
        arms = (middle - t1 - 0.5 * length(p), middle - 0.5 * (ta + tb))
        var = p[VAR_OFFSET] + q[VAR_OFFSET] + 4e-5
        var += p[VAR_THETA] * arms[0] ** 2 + q[VAR_THETA] * arms[1] ** 2
        found.append((_across(p, T.inverse().transform(at)), _huber(e, var, 3.0)))
        var = p[VAR_THETA] + q[VAR_THETA] + 1e-5
        found.append((_turned(p, q), _huber(turned, var, 3.0)))
        for side in range(2):
            if ref.ends[r, side] == EDGE == cur.ends[c, side]:
                slide = _along(p, cur.edges[c, side], ref.edges[r, side])
                if abs(slide(pose)) <= distance_gate:
                    found.append((slide, _huber(slide(pose), 0.0025, 2.0)))
    return found, total


def _across(line: Floats, point: Floats) -> Callable[[Floats], float]:
    return lambda x: float(normal(line) @ (Pose.from_array(x).transform(point) - start(line)))


def _turned(p: Floats, q: Floats) -> Callable[[Floats], float]:
    return lambda x: wrap(angle_of(q) + float(x[2]) - angle_of(p))


def _along(line: Floats, point: Floats, target: Floats) -> Callable[[Floats], float]:
    return lambda x: float(direction(line) @ (Pose.from_array(x).transform(point) - target))


def _huber(e: float, var: float, sigmas: float) -> float:
    limit = sigmas * math.sqrt(var)
    return 1.0 / var if abs(e) <= limit else limit / (abs(e) * var)


def normal_equations(found: list[Residual], pose: Floats) -> tuple[Floats, Floats]:
    """H = sum w J^T J, g = -sum w J^T e with a numeric Jacobian."""
    H, g, step = np.zeros((3, 3)), np.zeros(3), 1e-6
    for f, w in found:
        J = np.array([(f(pose + step * d) - f(pose - step * d)) / (2 * step) for d in np.eye(3)])
        H += w * np.outer(J, J)
        g -= w * J * f(pose)
    return H, g


def refine(
    ref: ScanFeatures, cur: ScanFeatures, pose: Floats, iterations: int
) -> tuple[Floats, Floats, float]:
    """Gauss-Newton with shrinking gates; the last pass only fills H."""
    angle_gate, distance_gate = math.radians(7.0), 0.25
    for it in range(iterations + 1):
        found, total = residuals(ref, cur, pose, angle_gate, distance_gate)
        H, g = normal_equations(found, pose)
        if it == iterations or total == 0.0:
            break
        pose = pose + np.linalg.solve(H + np.diag([25.0, 25.0, 100.0]), g)
        angle_gate = max(0.7 * angle_gate, math.radians(3.0))
        distance_gate = max(0.7 * distance_gate, 0.12)
    return pose, H, total


def nearest_beam(point: Floats, angle_min: float, increment: float) -> int:
    """Number of the beam nearest to a direction, counted on beyond the last one."""
    ahead = (math.atan2(point[1], point[0]) - angle_min + 0.5 * increment) % math.tau
    return int(ahead / increment)


def judge(
    point: Floats, ranges: Floats, angle_min: float, increment: float, base: float, slope: float
) -> int:
    """One point in the frame of a sweep."""
    b = nearest_beam(point, angle_min, increment)
    if b >= len(ranges) or not math.isfinite(ranges[b]):
        return OUTSIDE
    rho = math.hypot(*point)
    tolerance = base + slope * rho
    around = [ranges[q] for q in (b - 1, b, b + 1) if 0 <= q < len(ranges)]
    seen = [r for r in around if math.isfinite(r)]
    if any(abs(r - rho) <= tolerance for r in seen):
        return MATCHED
    for r in seen:  # between the ends of a slanted surface
        if abs(r - ranges[b]) < 0.5 and min(r, ranges[b]) <= rho <= max(r, ranges[b]):
            return MATCHED
    return CONFLICT if rho < min(seen) - tolerance else OCCLUDED


def judge_all(
    points: Floats, spacing: float, pose: Pose, sweep: Sweep, base: float, slope: float
) -> Floats:
    """Metres of wall by verdict; spacing: angle between neighbouring points' beams."""
    counts = np.zeros(4)
    for p in points:
        verdict = judge(pose.transform(p), *sweep, base, slope)
        counts[verdict] += min(math.hypot(*p) * spacing, 0.05)
    return counts


def judge_cloud(
    points: Floats,
    pose: Pose,
    sweeps: list[tuple[Pose, Sweep]],
    base: float,
    slope: float,
) -> Floats:
    """Points by what most of the sweeps that saw them say."""
    counts = np.zeros(4)
    for p in points:
        at = pose.transform(p)
        said = [judge(T.inverse().transform(at), *sweep, base, slope) for T, sweep in sweeps]
        hits, misses = said.count(MATCHED), said.count(CONFLICT)
        if hits and hits >= misses:
            counts[MATCHED] += 1
        elif misses:
            counts[CONFLICT] += 1
        else:
            counts[OCCLUDED if OCCLUDED in said else OUTSIDE] += 1
    return counts


def lying(
    ref: Floats, cur: Floats, pose: Pose, angle_gate: float, distance_gate: float, least: float
) -> list[tuple[float, ...]]:
    rows: list[tuple[float, ...]] = []
    for i, j in itertools.product(range(len(ref)), range(len(cur))):
        a, b = pose.transform(cur[j, :4].reshape(2, 2))
        angle = wrap(angle_of(cur[j]) + pose.theta - angle_of(ref[i]))
        distance = abs(float(normal(ref[i]) @ (0.5 * (a + b) - start(ref[i]))))
        shared = overlap(ref[i], a, b)
        if abs(angle) <= angle_gate and distance <= distance_gate and shared >= least:
            rows.append((i, j, shared, distance, angle))
    return rows
