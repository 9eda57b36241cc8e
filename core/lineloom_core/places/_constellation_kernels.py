"""Numba kernels of recognition by landmarks. Slow twins: tests/core/places/slow_constellations.py.

A landmark is a row x, y, kind and a unit vector: a free-standing object, whose vector says nothing,
or a corner at either end of an oriented line, with the line's direction.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel
from lineloom_core.matching._proposal_kernels import wrap_angle
from lineloom_core.matching._refinement_kernels import refine
from lineloom_core.places._kernels import judge_places, place_evidence

X, Y, KIND, COSINE, SINE = range(5)
OBJECT = 0
"""The kind that is no corner; those of corners are 1 and 2, by the end of their line."""
TURNS = 60
"""Steps of a turn in the vote."""
CELL = 1.0
"""m: of the vote for translations."""
NEAREST, FARTHEST = 2.0, 25.0
"""m: how far apart two landmarks are that vote: nearer ones tell no direction."""
SAME_DISTANCE, SAME_DIRECTION = 0.35, math.cos(0.2)
"""m, cosine: what two views of two landmarks may differ by: of a column each sees another side."""
GATES = 1.2, 0.7, 0.5
"""m: how near landmarks are paired, in turn; those within the last are in common."""
TWIN = 0.5, 0.1
"""m, rad: nearer hypotheses are one."""
LEAST = 6
"""Votes of a cell, and landmarks in common, below which chance does as well."""


@kernel
def find_objects(points, gap, most):  # type: ignore[no-untyped-def]
    """Middles (n, 2) of the clusters of points (linked up to `gap`) no larger than `most`."""
    n = points.shape[0]
    cluster = np.full(n, -1)
    waiting = np.empty(n, dtype=np.int64)
    found, count = np.empty((n, 2)), 0
    for seed in range(n):
        if cluster[seed] >= 0:
            continue
        cluster[seed], waiting[0] = seed, seed
        size, next_one = 1, 0
        left, right = points[seed, 0], points[seed, 0]
        low, high = points[seed, 1], points[seed, 1]
        while next_one < size:
            x, y = points[waiting[next_one], 0], points[waiting[next_one], 1]
            next_one += 1
            for k in range(n):
                if cluster[k] < 0 and math.hypot(points[k, 0] - x, points[k, 1] - y) <= gap:
                    cluster[k], waiting[size] = seed, k
                    size += 1
                    left, right = min(left, points[k, 0]), max(right, points[k, 0])
                    low, high = min(low, points[k, 1]), max(high, points[k, 1])
        if size >= 2 and math.hypot(right - left, high - low) < most:
            found[count, 0], found[count, 1] = 0.5 * (left + right), 0.5 * (low + high)
            count += 1
    return found[:count]


@kernel
def spans_of(landmarks):  # type: ignore[no-untyped-def]
    """Ordered pairs of landmarks, by distance: distance, direction (2), middle (2), and which."""
    n = landmarks.shape[0]
    spans, which = np.empty((n * (n - 1), 5)), np.empty((n * (n - 1), 2), dtype=np.int64)
    count = 0
    for i in range(n):
        for j in range(n):
            dx, dy = landmarks[j, X] - landmarks[i, X], landmarks[j, Y] - landmarks[i, Y]
            d = math.hypot(dx, dy)
            if i == j or d < NEAREST or d > FARTHEST:
                continue
            spans[count, 0], spans[count, 1], spans[count, 2] = d, dx / d, dy / d
            spans[count, 3] = 0.5 * (landmarks[i, X] + landmarks[j, X])
            spans[count, 4] = 0.5 * (landmarks[i, Y] + landmarks[j, Y])
            which[count, 0], which[count, 1] = i, j
            count += 1
    order = np.argsort(spans[:count, 0], kind="mergesort")
    return spans[:count][order], which[:count][order]


@kernel
def are_alike(a, b, c, s):  # type: ignore[no-untyped-def]
    """Whether two landmarks may be one if the second's frame is turned by (c, s)."""
    if a[KIND] != b[KIND]:
        return False
    if a[KIND] == OBJECT:
        return True
    along = a[COSINE] * b[COSINE] + a[SINE] * b[SINE]
    across = a[SINE] * b[COSINE] - a[COSINE] * b[SINE]
    return along * c + across * s > SAME_DIRECTION


@kernel
def vote_constellations(ref, cur, half, votes):  # type: ignore[no-untyped-def]
    """Pairs as far apart in both vote for the pose that lays one on the other.

    votes: (TURNS, n, n) zeros, cells of `CELL` from -half on.
    """
    n = votes.shape[1]
    ref_spans, ref_which = spans_of(ref)
    cur_spans, cur_which = spans_of(cur)
    distances = cur_spans[:, 0].copy()
    for r in range(ref_spans.shape[0]):
        a, i, j = ref_spans[r], ref_which[r, 0], ref_which[r, 1]
        if i > j:
            continue  # of each pair one order will do
        first = np.searchsorted(distances, a[0] - SAME_DISTANCE)
        last = np.searchsorted(distances, a[0] + SAME_DISTANCE)
        for k in range(first, last):
            p, q = cur_which[k, 0], cur_which[k, 1]
            if ref[i, KIND] != cur[p, KIND] or ref[j, KIND] != cur[q, KIND]:
                continue
            b = cur_spans[k]
            c, s = a[1] * b[1] + a[2] * b[2], a[2] * b[1] - a[1] * b[2]
            x = math.floor((a[3] - (c * b[3] - s * b[4]) + half) / CELL)
            y = math.floor((a[4] - (s * b[3] + c * b[4]) + half) / CELL)
            if x < 0 or y < 0 or x >= n or y >= n:
                continue
            if are_alike(ref[i], cur[p], c, s) and are_alike(ref[j], cur[q], c, s):
                turn = int((math.atan2(s, c) + math.pi) * TURNS / (2.0 * math.pi)) % TURNS
                votes[turn, x, y] += 1


@kernel
def count_common(ref, cur, pose, gate, pairs):  # type: ignore[no-untyped-def]
    """Landmarks in common at a pose, each with the nearest alike: their number and the objects'.

    pairs (m, 2) is overwritten as far as that number goes.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    count = objects = 0
    for k in range(cur.shape[0]):
        x = c * cur[k, X] - s * cur[k, Y] + pose[0]
        y = s * cur[k, X] + c * cur[k, Y] + pose[1]
        best, nearest = gate, -1
        for i in range(ref.shape[0]):
            d = math.hypot(ref[i, X] - x, ref[i, Y] - y)
            if d < best and are_alike(ref[i], cur[k], c, s):
                best, nearest = d, i
        if nearest >= 0:
            pairs[count, 0], pairs[count, 1] = nearest, k
            count += 1
            objects += cur[k, KIND] == OBJECT
    return count, objects


@kernel
def lay_on(ref, cur, pairs, count, pose):  # type: ignore[no-untyped-def]
    """Move `pose` to where paired landmarks lie nearest on each other (least squares)."""
    ax = ay = bx = by = 0.0
    for k in range(count):
        i, j = pairs[k, 0], pairs[k, 1]
        ax, ay = ax + ref[i, X] / count, ay + ref[i, Y] / count
        bx, by = bx + cur[j, X] / count, by + cur[j, Y] / count
    cosine = sine = 0.0
    for k in range(count):
        i, j = pairs[k, 0], pairs[k, 1]
        px, py, qx, qy = ref[i, X] - ax, ref[i, Y] - ay, cur[j, X] - bx, cur[j, Y] - by
        cosine += qx * px + qy * py
        sine += qx * py - qy * px
    pose[2] = math.atan2(sine, cosine)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    pose[0], pose[1] = ax - (c * bx - s * by), ay - (s * bx + c * by)


@kernel
def propose_constellations(ref, cur, half, most):  # type: ignore[no-untyped-def]
    """Poses that lay many landmarks on their like, most first: x, y, theta, votes, in common."""
    n = math.ceil(2.0 * half / CELL)
    votes = np.zeros((TURNS, n, n), dtype=np.int32)
    vote_constellations(ref, cur, half, votes)
    heard = np.flatnonzero(votes.ravel() >= LEAST)
    weight = votes.ravel()[heard]
    order = np.argsort(-weight, kind="mergesort")
    found, kept = np.empty((most, 5)), 0
    pairs = np.empty((cur.shape[0], 2), dtype=np.int64)
    pose = np.empty(3)
    for k in order:
        if kept == most:
            break
        cell = heard[k]
        turn, x, y = cell // (n * n), cell // n % n, cell % n
        if votes[turn, x, y] == 0:
            continue  # next to a better one
        for a in range(-1, 2):
            votes[(turn + a) % TURNS, max(x - 1, 0) : x + 2, max(y - 1, 0) : y + 2] = 0
        pose[0], pose[1] = (x + 0.5) * CELL - half, (y + 0.5) * CELL - half
        pose[2] = (turn + 0.5) * 2.0 * math.pi / TURNS - math.pi
        count = 0
        for gate in GATES:
            count, _ = count_common(ref, cur, pose, gate, pairs)
            if count < LEAST:
                break
            lay_on(ref, cur, pairs, count, pose)
        if count < LEAST:
            continue
        found[kept, :3], found[kept, 3], found[kept, 4] = pose, weight[k], count
        kept += 1
    return found[:kept][np.argsort(-found[:kept, 4], kind="mergesort")]


@kernel
def match_constellations(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, ref_points, ref_ranges, ref_mins, ref_incs, ref_poses,
    cur, cur_ends, cur_edges, cur_points, cur_ranges, cur_mins, cur_incs, cur_poses,
    ref_landmarks, cur_landmarks, half, most, keep, iterations, base, slope,
):  # fmt: skip
    """Hypotheses by landmarks, judged as `match_places` does and in its columns, best first.

    One more column says how many objects both saw.
    """
    proposals = propose_constellations(ref_landmarks, cur_landmarks, half, most)
    n = min(proposals.shape[0], keep)
    out, kept = np.empty((n, 11)), 0
    counts, H, rank = np.zeros(4), np.empty((3, 3)), np.empty(n)
    pairs = np.empty((cur_landmarks.shape[0], 2), dtype=np.int64)
    for k in range(n):
        pose = proposals[k, :3].copy()
        overlap = refine(ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, pose, H, iterations)
        twin = False
        for q in range(kept):
            near = math.hypot(out[q, 0] - pose[0], out[q, 1] - pose[1]) < TWIN[0]
            twin = twin or (near and abs(wrap_angle(out[q, 2] - pose[2])) < TWIN[1])
        if twin:
            continue
        judge_places(
            ref_points, ref_ranges, ref_mins, ref_incs, ref_poses,
            cur_points, cur_ranges, cur_mins, cur_incs, cur_poses,
            pose, 2, base, slope, counts,
        )  # fmt: skip
        _, objects = count_common(ref_landmarks, cur_landmarks, pose, GATES[-1], pairs)
        out[kept, :3], out[kept, 3], out[kept, 4] = pose, proposals[k, 4], proposals[k, 3]
        out[kept, 5:9], out[kept, 9], out[kept, 10] = 2.0 * counts, overlap, objects
        rank[kept] = place_evidence(out[kept, 5], out[kept, 6], overlap)
        kept += 1
    return out[:kept][np.argsort(-rank[:kept], kind="mergesort")]
