"""The numba kernels of the whole pairwise match: a table of settled hypotheses in one call.

Sweeps are `_sweep.Sweep`. A hypothesis is a row of COLUMNS numbers. Slow twins:
tests/core/matching/test_whole_match_kernels.py.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel
from lineloom_core.matching._agreement_kernels import (
    BEST,
    FIGURES,
    LEAN,
    OTHER,
    SLIDE,
    WALLS,
    compare_with_rivals,
)
from lineloom_core.matching._band_kernels import propose_slides
from lineloom_core.matching._circle_match_kernels import propose_circles
from lineloom_core.matching._free_space_kernels import (
    CONFLICT,
    MATCHED,
    judge_pair,
    judge_thinned,
    thin_points,
)
from lineloom_core.matching._hypothesis import (
    COLUMNS,
    evidence,
    fill_row,
    is_known,
    translation_information,
)
from lineloom_core.matching._proposal_kernels import propose
from lineloom_core.matching._refinement_kernels import refine_all

COARSE_BASE, COARSE_SLOPE, COARSE_STRIDE = 0.26, 0.02, 0.3
FINE_BASE, FINE_SLOPE, FINE_STEP = 0.05, 0.005, 2
"""Range tolerances [m], their growth with range, metres of wall or beams from point to point."""
SETTLED_ABOVE = 1500.0
"""Information [1/m^2] by lines above which free space cannot say more of a slide."""
SLIDE_HALF, SLIDE_STEP, SLIDE_STRIDE, SLIDE_PULL = 0.4, 0.1, 0.1, 0.15
ALWAYS_COARSE, ALWAYS_FINE, WORTH_A_LOOK, WORTH_WHEN_SAFE = 6, 3, 0.5, 0.8
MOST_SLIDES, HOPELESS = 8, 0.4
SAFE_EVIDENCE, SAFE_WALLS, SAFE_LEAN, SAFE_RIVAL = 4.0, 3.0, 0.2, 0.5
"""Evidence [m], walls, metres that fix the weaker direction, and the rival's share of evidence."""


@kernel
def settle_slide(ref, cur, ref_thin, cur_thin, H, pose, hopeless):  # type: ignore[no-untyped-def]
    """Where lines hardly fix `pose` along one direction, slide it to where the points fit best.

    hopeless: what matches less than this [m] stays where it is.
    """
    least, direction = translation_information(H[0, 0], H[0, 1], H[0, 2], H[1, 1], H[1, 2], H[2, 2])
    if least >= SETTLED_ABOVE:
        return
    ux, uy = math.cos(direction), math.sin(direction)
    n = int(SLIDE_HALF / SLIDE_STEP + 0.5)
    counts = np.empty(4)
    moved = pose.copy()
    judge_thinned(ref, cur, ref_thin, cur_thin, pose, FINE_BASE, FINE_SLOPE, counts)
    best, where = SLIDE_STRIDE * (counts[MATCHED] - 3.0 * counts[CONFLICT]), 0
    if SLIDE_STRIDE * counts[MATCHED] < hopeless:
        return
    for k in range(-n, n + 1):
        if k == 0:
            continue
        moved[0], moved[1] = pose[0] + ux * k * SLIDE_STEP, pose[1] + uy * k * SLIDE_STEP
        judge_thinned(ref, cur, ref_thin, cur_thin, moved, FINE_BASE, FINE_SLOPE, counts)
        value = SLIDE_STRIDE * (counts[MATCHED] - 3.0 * counts[CONFLICT])
        value -= SLIDE_PULL * abs(k) / n
        if value > best + 1e-9:
            best, where = value, k
    pose[0] += ux * where * SLIDE_STEP
    pose[1] += uy * where * SLIDE_STEP


@kernel
def settle(ref, cur, ref_thin, cur_thin, row, iterations, table, kept):  # type: ignore[no-untyped-def]
    """Refine a proposal (x, y, theta, explained, votes), judge it, and add it to the table.

    Returns the number of rows; proposals that end where another did are not kept.
    """
    pose = row[:3].copy()
    H = np.empty((3, 3))
    overlap = refine_all(
        ref.lines, ref.ends, ref.edges, ref.circles, cur.lines, cur.ends, cur.edges, cur.circles,
        pose, H, iterations,
    )  # fmt: skip
    if overlap == 0.0 or is_known(table, kept, pose):
        return kept
    hopeless = HOPELESS * table[:kept, 5].max() if kept > 0 else 0.0
    settle_slide(ref, cur, ref_thin, cur_thin, H, pose, hopeless)
    if is_known(table, kept, pose):
        return kept
    counts = np.empty(4)
    judge_pair(
        ref.points, ref.ranges, ref.angle_min, ref.angle_increment,
        cur.points, cur.ranges, cur.angle_min, cur.angle_increment,
        pose, FINE_STEP, FINE_BASE, FINE_SLOPE, counts,
    )  # fmt: skip
    fill_row(table[kept], pose, row[3], row[4], FINE_STEP * counts, overlap, H)
    return kept + 1


@kernel
def rank_coarsely(ref, cur, proposals, most):  # type: ignore[no-untyped-def]
    """Steps 3 and 5, coarse: what lines explain and free space says. Rank by proposal."""
    ref_thin = thin_points(ref.points, ref.angle_increment, COARSE_STRIDE)
    cur_thin = thin_points(cur.points, cur.angle_increment, COARSE_STRIDE)
    n = min(proposals.shape[0], most)
    counts = np.empty(4)
    rank = np.empty(n)
    for k in range(n):
        # Far behind the best in explained length: no look at free space makes up for that.
        if k >= ALWAYS_COARSE and proposals[k, 3] < WORTH_A_LOOK * proposals[0, 3]:
            return rank[:k]
        judge_thinned(ref, cur, ref_thin, cur_thin, proposals[k], COARSE_BASE, COARSE_SLOPE, counts)
        rank[k] = proposals[k, 3] + COARSE_STRIDE * (counts[MATCHED] - 2.0 * counts[CONFLICT])
    return rank


@kernel
def best_first(table, kept):  # type: ignore[no-untyped-def]
    """The first `kept` rows by falling evidence; equals keep their order."""
    rank = np.empty(kept)
    for k in range(kept):
        rank[k] = evidence(table[k])
    return table[:kept][np.argsort(-rank, kind="mergesort")]


@kernel
def is_safe(figures):  # type: ignore[no-untyped-def]
    """Need nobody look for slides: walls of several directions fit, and nothing else does."""
    best = figures[BEST]
    return (
        best > SAFE_EVIDENCE
        and figures[WALLS] >= SAFE_WALLS
        and figures[LEAN] >= SAFE_LEAN
        and max(figures[OTHER], figures[SLIDE]) < SAFE_RIVAL * best
    )


@kernel
def settle_proposals(  # type: ignore[no-untyped-def]
    ref, cur, ref_thin, cur_thin, proposals, rank, most, iterations, table, figures
):
    """Steps 4, 5 and 7 on the best ranked proposals; returns the number of rows, best first.

    Once a hypothesis is safe, only proposals that nearly rank with the best are looked at.
    """
    order = np.argsort(-rank, kind="mergesort")
    kept, worth = 0, WORTH_A_LOOK
    for q in range(min(order.shape[0], most)):
        if q == ALWAYS_FINE:
            table[:kept] = best_first(table, kept)
            compare_with_rivals(ref, cur, table, kept, figures)
            if is_safe(figures):
                worth = WORTH_WHEN_SAFE
        if q >= ALWAYS_FINE and rank[order[q]] < worth * rank[order[0]]:
            break
        row = proposals[order[q]]
        kept = settle(ref, cur, ref_thin, cur_thin, row, iterations, table, kept)
    table[:kept] = best_first(table, kept)
    compare_with_rivals(ref, cur, table, kept, figures)
    return kept


@kernel
def match_sweeps(ref, cur, search):  # type: ignore[no-untyped-def]
    """Steps 1 to 7 on two sweeps: the settled hypotheses, best first, and the best one's figures.

    First the votes of lines (and circles). Where these leave a doubt, all slides of parallel walls
    that may be the same are looked at as well, also those of the best hypothesis so far.
    """
    proposals = propose(
        ref.lines, ref.ends, ref.edges, cur.lines, cur.ends, cur.edges, search.rotations,
        search.cells, search.least_share, search.pair_limit, search.cell, search.half, search.reach,
    )  # fmt: skip
    if ref.circles.shape[0] > 0 and cur.circles.shape[0] > 0:
        proposals = propose_circles(
            ref.lines, ref.circles, cur.lines, cur.circles, proposals,
            search.per_circle, search.pair_limit, search.half, search.reach,
        )  # fmt: skip
    ref_thin = thin_points(ref.points, ref.angle_increment, SLIDE_STRIDE)
    cur_thin = thin_points(cur.points, cur.angle_increment, SLIDE_STRIDE)
    table = np.empty((search.fine_keep + MOST_SLIDES, COLUMNS))
    rank = rank_coarsely(ref, cur, proposals, search.coarse_keep)
    figures = np.zeros(FIGURES)
    kept = settle_proposals(
        ref, cur, ref_thin, cur_thin, proposals, rank, search.fine_keep, search.iterations, table,
        figures,
    )  # fmt: skip
    if not is_safe(figures):
        slides = propose_slides(ref, cur, table, kept, figures, search.rotations, MOST_SLIDES)
        for k in range(slides.shape[0]):
            kept = settle(ref, cur, ref_thin, cur_thin, slides[k], search.iterations, table, kept)
        table[:kept] = best_first(table, kept)
        compare_with_rivals(ref, cur, table, kept, figures)
    return table[:kept], figures
