"""Numba kernels: what the best hypothesis rests on, and how far its rivals are behind."""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._kernels import THETA
from lineloom_core.kernels import kernel
from lineloom_core.matching._circle_match_kernels import arc_length, centre_residual, same_circle
from lineloom_core.matching._hypothesis import (
    CONFLICT,
    INFORMATION,
    evidence,
    translation_information,
)
from lineloom_core.matching._proposal_kernels import lying_pairs, wrap_angle

BEST, OTHER, UNREFUTED, SLIDE, WALLS, LEAN, BROAD, FACING, AXIS = range(9)
FIGURES = 9
"""Evidence [m] of the best hypothesis, of the best other place, of the best other place that hardly
more contradicts than the best, of the best slide along its walls;
number of walls that agree; metres of wall that fix the weaker and the stronger direction of the
translation; metres that agree on the side that has fewer, of the two that face each other; the
direction [rad] that fewest walls fix."""
LYING_ANGLE, LYING_DISTANCE, LYING_OVERLAP = math.radians(5.0), 0.12, 0.1
APART, TURNED = 0.3, 0.15
"""From here on a hypothesis is another place [m, rad]."""
NO_CONFLICT = 0.1
"""Metres of wall in conflict that refute nothing."""
SLIDE_ACROSS, SLIDE_GROWTH, SLIDE_TURN = 0.25, 0.02, 0.07
"""Up to here [m, m per metre along, rad] it is the same place but for a slide."""


@kernel
def agreement(ref, cur, pose, figures):  # type: ignore[no-untyped-def]
    """Fill WALLS to AXIS: which walls, and circles, lie on each other under `pose`."""
    pairs = lying_pairs(ref.lines, cur.lines, pose, LYING_ANGLE, LYING_DISTANCE, LYING_OVERLAP)
    used_ref = np.zeros(ref.lines.shape[0], dtype=np.bool_)
    used_cur = np.zeros(cur.lines.shape[0], dtype=np.bool_)
    xx = xy = yy = 0.0
    for k in range(pairs.shape[0]):
        i, j, w = int(pairs[k, 0]), int(pairs[k, 1]), pairs[k, 2]
        used_ref[i], used_cur[j] = True, True
        nx, ny = -math.sin(ref.lines[i, THETA]), math.cos(ref.lines[i, THETA])
        xx += w * nx * nx
        xy += w * nx * ny
        yy += w * ny * ny
    c, s = math.cos(pose[2]), math.sin(pose[2])
    round_walls = 0.0
    for i in range(ref.circles.shape[0]):
        for j in range(cur.circles.shape[0]):
            ex, ey = centre_residual(ref.circles[i], cur.circles[j], c, s, pose)[:2]
            if same_circle(ref.circles[i], cur.circles[j]) and math.hypot(ex, ey) < LYING_DISTANCE:
                half = 0.5 * arc_length(ref.circles[i], cur.circles[j])
                xx += half
                yy += half
                round_walls += 2.0  # a centre fixes a point, as two walls do
    strong = 0.5 * math.atan2(2.0 * xy, xx - yy)
    spread = math.hypot(0.5 * (xx - yy), xy)
    figures[WALLS] = min(used_ref.sum(), used_cur.sum()) + round_walls
    figures[LEAN], figures[BROAD] = max(0.5 * (xx + yy) - spread, 0.0), 0.5 * (xx + yy) + spread
    figures[AXIS] = np.mod(strong + 0.5 * math.pi, math.pi)
    one = other = 0.0
    for k in range(pairs.shape[0]):
        along = math.cos(ref.lines[int(pairs[k, 0]), THETA] - figures[AXIS])
        if along > 0.95:
            one += pairs[k, 2]
        elif along < -0.95:
            other += pairs[k, 2]
    figures[FACING] = min(one, other)
    return pairs.shape[0] > 0 or round_walls > 0.0


@kernel
def is_apart(row, best):  # type: ignore[no-untyped-def]
    """Is a hypothesis another place than the best one?"""
    far = math.hypot(row[0] - best[0], row[1] - best[1]) > APART
    return far or abs(wrap_angle(row[2] - best[2])) > TURNED


@kernel
def is_slide(row, best, axis):  # type: ignore[no-untyped-def]
    """Is it the same place as the best one but for a slide along `axis`?"""
    dx, dy = row[0] - best[0], row[1] - best[1]
    across = abs(math.cos(axis) * dy - math.sin(axis) * dx)
    if across > SLIDE_ACROSS + SLIDE_GROWTH * math.hypot(dx, dy):
        return False
    return abs(wrap_angle(row[2] - best[2])) < SLIDE_TURN


@kernel
def compare_with_rivals(ref, cur, table, kept, figures):  # type: ignore[no-untyped-def]
    """Fill all figures of the first row, the best, of a table of `kept` hypotheses."""
    figures[:] = 0.0
    if kept == 0:
        return
    best = table[0]
    if not agreement(ref, cur, best[:3], figures):
        h = best[INFORMATION:]
        figures[AXIS] = translation_information(h[0], h[1], h[2], h[3], h[4], h[5])[1]
    figures[BEST] = evidence(best)
    for k in range(1, kept):
        if not is_apart(table[k], best):
            continue
        which = SLIDE if is_slide(table[k], best, figures[AXIS]) else OTHER
        figures[which] = max(figures[which], evidence(table[k]))
        if which == OTHER and table[k, CONFLICT] <= best[CONFLICT] + NO_CONFLICT:
            figures[UNREFUTED] = max(figures[UNREFUTED], evidence(table[k]))
