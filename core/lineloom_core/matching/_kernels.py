"""The numba kernels of the whole pairwise match, steps 1 to 5 in one call."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lineloom_core.features._circle_kernels import CIRCLE_COLUMNS
from lineloom_core.matching._circle_match_kernels import propose_circles
from lineloom_core.matching._free_space_kernels import CONFLICT, MATCHED, judge_pair
from lineloom_core.matching._proposal_kernels import propose, wrap_angle
from lineloom_core.matching._refinement_kernels import refine_all

COARSE_STEP, FINE_STEP = 6, 2
ALWAYS_COARSE, ALWAYS_FINE, WORTH_A_LOOK = 6, 3, 0.5


@njit(cache=True)
def fill_row(out, pose, explained, votes, counts, overlap, H):  # type: ignore[no-untyped-def]
    """Write a hypothesis: x, y, theta, explained, votes, four counts, overlap, upper H."""
    out[:3] = pose
    out[3], out[4] = explained, votes
    out[5:9] = counts
    out[9] = overlap
    out[10], out[11], out[12] = H[0, 0], H[0, 1], H[0, 2]
    out[13], out[14], out[15] = H[1, 1], H[1, 2], H[2, 2]


@njit(cache=True)
def judge_proposals(  # type: ignore[no-untyped-def]
    proposals, ref, ref_ends, ref_edges, ref_circles, ref_points, ref_ranges, ref_min, ref_inc,
    cur, cur_ends, cur_edges, cur_circles, cur_points, cur_ranges, cur_min, cur_inc,
    coarse_keep, fine_keep, iterations, base, slope,
):  # fmt: skip
    """Steps 4 and 5: rank by what free space says coarsely, refine, check in full; see below."""
    n = min(proposals.shape[0], coarse_keep)
    counts = np.zeros(4)
    rank = np.empty(n)
    for k in range(n):
        # Far behind the best in explained length: no look at free space makes up for that.
        if k >= ALWAYS_COARSE and proposals[k, 3] < WORTH_A_LOOK * proposals[0, 3]:
            n = k
            break
        judge_pair(
            ref_points, ref_ranges, ref_min, ref_inc, cur_points, cur_ranges, cur_min, cur_inc,
            proposals[k, :3], COARSE_STEP, base + 0.15, slope + 0.01, counts,
        )  # fmt: skip
        rank[k] = proposals[k, 3] + COARSE_STEP * (counts[MATCHED] - 2.0 * counts[CONFLICT])
    order = np.argsort(-rank[:n], kind="mergesort")
    m = min(n, fine_keep)
    out = np.empty((m, 16))
    H = np.empty((3, 3))
    kept = 0
    for q in range(m):
        if q >= ALWAYS_FINE and rank[order[q]] < WORTH_A_LOOK * rank[order[0]]:
            break
        row = proposals[order[q]]
        pose = row[:3].copy()
        overlap = refine_all(
            ref, ref_ends, ref_edges, ref_circles, cur, cur_ends, cur_edges, cur_circles,
            pose, H, iterations,
        )  # fmt: skip
        if overlap == 0.0:
            continue
        twin = False
        for k in range(kept):
            near = math.hypot(out[k, 0] - pose[0], out[k, 1] - pose[1]) < 0.08
            twin = twin or (near and abs(wrap_angle(out[k, 2] - pose[2])) < 0.03)
        if twin:
            continue
        judge_pair(
            ref_points, ref_ranges, ref_min, ref_inc, cur_points, cur_ranges, cur_min, cur_inc,
            pose, FINE_STEP, base, slope, counts,
        )  # fmt: skip
        fill_row(out[kept], pose, row[3], row[4], FINE_STEP * counts, overlap, H)
        kept += 1
    rank = np.empty(kept)
    for k in range(kept):
        rank[k] = evidence(out[k])
    return out[:kept][np.argsort(-rank, kind="mergesort")]


@njit(cache=True)
def match_sweeps(  # type: ignore[no-untyped-def]
    ref,
    ref_ends,
    ref_edges,
    ref_points,
    ref_ranges,
    ref_min,
    ref_inc,
    cur,
    cur_ends,
    cur_edges,
    cur_points,
    cur_ranges,
    cur_min,
    cur_inc,
    rotations,
    cells,
    least_share,
    pair_limit,
    cell,
    half,
    reach,
    coarse_keep,
    fine_keep,
    iterations,
    base,
    slope,
):
    """Steps 1 to 6 on two sweeps.

    Returns the refined hypotheses, best first, as rows
    x, y, theta, explained, votes, matched, conflict, occluded, outside, overlap, H (6 numbers).
    """
    proposals = propose(
        ref, ref_ends, ref_edges, cur, cur_ends, cur_edges,
        rotations, cells, least_share, pair_limit, cell, half, reach,
    )  # fmt: skip
    none = np.empty((0, CIRCLE_COLUMNS))
    return judge_proposals(
        proposals, ref, ref_ends, ref_edges, none, ref_points, ref_ranges, ref_min, ref_inc,
        cur, cur_ends, cur_edges, none, cur_points, cur_ranges, cur_min, cur_inc,
        coarse_keep, fine_keep, iterations, base, slope,
    )  # fmt: skip


@njit(cache=True)
def match_round_sweeps(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, ref_circles, ref_points, ref_ranges, ref_min, ref_inc,
    cur, cur_ends, cur_edges, cur_circles, cur_points, cur_ranges, cur_min, cur_inc,
    rotations, cells, least_share, pair_limit, cell, half, reach,
    coarse_keep, fine_keep, iterations, base, slope, per_circle,
):  # fmt: skip
    """`match_sweeps` of two sweeps that both show circles: these propose and refine as well."""
    by_lines = propose(
        ref, ref_ends, ref_edges, cur, cur_ends, cur_edges,
        rotations, cells, least_share, pair_limit, cell, half, reach,
    )  # fmt: skip
    proposals = propose_circles(
        ref, ref_circles, cur, cur_circles, by_lines, per_circle, pair_limit, half, reach
    )
    return judge_proposals(
        proposals, ref, ref_ends, ref_edges, ref_circles, ref_points, ref_ranges, ref_min, ref_inc,
        cur, cur_ends, cur_edges, cur_circles, cur_points, cur_ranges, cur_min, cur_inc,
        coarse_keep, fine_keep, iterations, base, slope,
    )  # fmt: skip


@njit(cache=True)
def evidence(row):  # type: ignore[no-untyped-def]
    """What speaks for a hypothesis, in metres of wall: overlap and matched, less conflicts."""
    return row[9] + row[5] - 3.0 * row[6]
