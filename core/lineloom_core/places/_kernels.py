"""Numba kernels of place recognition. Slow twins: tests/core/places/slow_twins.py."""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel
from lineloom_core.matching._free_space_kernels import (
    CONFLICT,
    MATCHED,
    invert_pose,
    judge_cloud,
    judge_point,
)
from lineloom_core.matching._proposal_kernels import propose, wrap_angle
from lineloom_core.matching._refinement_kernels import refine


@kernel
def judge_places(  # type: ignore[no-untyped-def]
    ref_points,
    ref_ranges,
    ref_mins,
    ref_incs,
    ref_poses,
    cur_points,
    cur_ranges,
    cur_mins,
    cur_incs,
    cur_poses,
    pose,
    step,
    base,
    slope,
    counts,
):
    """Free-space check both ways between two places; counts (4,) of points is overwritten."""
    counts[:] = 0.0
    judge_cloud(
        cur_points, step, pose, ref_ranges, ref_mins, ref_incs, ref_poses, base, slope, counts
    )
    back = np.empty(3)
    invert_pose(pose, back)
    judge_cloud(
        ref_points, step, back, cur_ranges, cur_mins, cur_incs, cur_poses, base, slope, counts
    )


@kernel
def tally_sweeps(  # type: ignore[no-untyped-def]
    points, pose, ranges, angle_mins, angle_increments, poses, base, slope, out
):
    """How many sweeps measured each point (out[:, 0]) and how many saw through it (out[:, 1]).

    points (n, 2) in frame A, moved by `pose` into the frame of the sweeps.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    cs, ss = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    per_radian = 1.0 / angle_increments
    turns = 2.0 * math.pi * per_radian
    for k in range(points.shape[0]):
        x = c * points[k, 0] - s * points[k, 1] + pose[0]
        y = s * points[k, 0] + c * points[k, 1] + pose[1]
        hits = misses = 0
        for q in range(ranges.shape[0]):
            dx, dy = x - poses[q, 0], y - poses[q, 1]
            verdict = judge_point(
                cs[q] * dx + ss[q] * dy, cs[q] * dy - ss[q] * dx, ranges[q],
                angle_mins[q], per_radian[q], turns[q], base, slope,
            )  # fmt: skip
            if verdict == MATCHED:
                hits += 1
            elif verdict == CONFLICT:
                misses += 1
        out[k, 0], out[k, 1] = hits, misses


@kernel
def match_places(  # type: ignore[no-untyped-def]
    ref,
    ref_ends,
    ref_edges,
    ref_points,
    ref_ranges,
    ref_mins,
    ref_incs,
    ref_poses,
    cur,
    cur_ends,
    cur_edges,
    cur_points,
    cur_ranges,
    cur_mins,
    cur_incs,
    cur_poses,
    rotations,
    cells,
    least_share,
    pair_limit,
    cell,
    half,
    reach,
    least_explained,
    coarse_keep,
    fine_keep,
    iterations,
    base,
    slope,
):
    """The matcher's steps 1 to 6 on fused lines and many sweeps.

    A cascade: where the votes' best cell explains less than `least_explained` metres of line,
    nothing dearer is tried.

    Returns refined hypotheses, best first, as rows
    x, y, theta, explained, votes, matched, conflict, occluded, outside, overlap.
    """
    proposals = propose(
        ref, ref_ends, ref_edges, cur, cur_ends, cur_edges,
        rotations, cells, least_share, pair_limit, cell, half, reach,
    )  # fmt: skip
    if proposals.shape[0] == 0 or proposals[0, 3] < least_explained:
        return np.empty((0, 10))
    n = min(proposals.shape[0], coarse_keep)
    counts = np.zeros(4)
    rank = np.empty(n)
    # The coarse pass sees every third sweep and every eighth point.
    for k in range(n):
        judge_places(
            ref_points, ref_ranges[::3], ref_mins[::3], ref_incs[::3], ref_poses[::3],
            cur_points, cur_ranges[::3], cur_mins[::3], cur_incs[::3], cur_poses[::3],
            proposals[k, :3], 8, base + 0.15, slope + 0.01, counts,
        )  # fmt: skip
        rank[k] = proposals[k, 3] + 0.4 * (counts[MATCHED] - 2.0 * counts[CONFLICT])
    order = np.argsort(-rank, kind="mergesort")
    m = min(n, fine_keep)
    out = np.empty((m, 10))
    H = np.empty((3, 3))
    kept = 0
    for q in range(m):
        row = proposals[order[q]]
        pose = row[:3].copy()
        overlap = refine(ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, pose, H, iterations)
        if overlap == 0.0:
            continue
        twin = False
        for k in range(kept):
            near = math.hypot(out[k, 0] - pose[0], out[k, 1] - pose[1]) < 0.15
            twin = twin or (near and abs(wrap_angle(out[k, 2] - pose[2])) < 0.05)
        if twin:
            continue
        judge_places(
            ref_points, ref_ranges, ref_mins, ref_incs, ref_poses,
            cur_points, cur_ranges, cur_mins, cur_incs, cur_poses,
            pose, 2, base, slope, counts,
        )  # fmt: skip
        out[kept, :3] = pose
        out[kept, 3], out[kept, 4] = row[3], row[4]
        out[kept, 5:9] = 2.0 * counts
        out[kept, 9] = overlap
        kept += 1
    rank = np.empty(kept)
    for k in range(kept):
        rank[k] = place_evidence(out[k, 5], out[k, 6], out[k, 9])
    return out[:kept][np.argsort(-rank, kind="mergesort")]


@kernel
def place_evidence(matched, conflict, overlap):  # type: ignore[no-untyped-def]
    """What speaks for a hypothesis, in metres: points are cells of 0.1 m."""
    return overlap + 0.1 * matched - 0.3 * conflict
