"""Numba kernel of what later scans say of a line. Slow twin: tests/core/fusion/test_persistence.py.

A line is cut into equal pieces. A beam towards the middle of a piece sees it, passes through its
place, or says nothing: where something stands before it, where the beam did not come back, where it
meets the line at a grazing angle, and where it ends neither on the line nor clearly behind it.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel
from lineloom_core.matching._free_space_kernels import beam_of

SEEN, THROUGH, NOTHING = 1, -1, 0
LEAST_SINE = 0.2
CLOSEST_M = 0.15


@kernel
def look(px, py, ux, uy, pose, c, s, ranges, angle_min, increment, reach, near, far):  # type: ignore[no-untyped-def]
    """What one sweep says of a point on a line of direction (ux, uy), free side on the left."""
    dx, dy = px - pose[0], py - pose[1]
    rho = math.sqrt(dx * dx + dy * dy)
    if rho < CLOSEST_M or rho > reach:
        return NOTHING
    height = uy * dx - ux * dy  # of the laser over the line, towards its free side
    if abs(height) < LEAST_SINE * rho:
        return NOTHING
    per_radian = 1.0 / increment
    b = beam_of(c * dx + s * dy, c * dy - s * dx, angle_min, per_radian, 2.0 * math.pi * per_radian)
    n = ranges.shape[0]
    if b >= n or not math.isfinite(ranges[b]):
        return NOTHING
    depth = (ranges[b] / rho - 1.0) * abs(height)
    if abs(depth) <= near:
        return SEEN if height > 0.0 else NOTHING
    if depth <= far:
        return NOTHING
    for q in (b - 1, b + 1):  # an edge next to the beam would make it a matter of luck
        if 0 <= q < n and not (ranges[q] / rho - 1.0) * abs(height) > far:
            return NOTHING
    return THROUGH


@kernel
def balances(  # type: ignore[no-untyped-def]
    lines, first_piece, poses, sweeps, starts, ranges, reach, near, far, most_sweeps, most_looks,
    most, loss, out,
):  # fmt: skip
    """Balance of every piece after all sweeps, in their order; 0 = faded, `most` = certain.

    lines (m, 4); line i owns out[first_piece[i] : first_piece[i + 1]]. Of the sweeps within
    `reach` of a line the latest `most_sweeps` are asked, and of what they say the latest
    `most_looks` count: a balance that saturates forgets what was before.
    """
    cs, ss = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    near_by = np.empty(most_sweeps, dtype=np.int64)
    said = np.empty(most_looks, dtype=np.int64)
    for i in range(lines.shape[0]):
        x1, y1 = lines[i, 0], lines[i, 1]
        length = math.hypot(lines[i, 2] - x1, lines[i, 3] - y1)
        ux, uy = (lines[i, 2] - x1) / length, (lines[i, 3] - y1) / length
        count = 0
        for k in range(poses.shape[0] - 1, -1, -1):
            along = (poses[k, 0] - x1) * ux + (poses[k, 1] - y1) * uy
            across = (poses[k, 1] - y1) * ux - (poses[k, 0] - x1) * uy
            over = max(-along, along - length, 0.0)
            if over * over + across * across > reach * reach:
                continue
            near_by[count] = k
            count += 1
            if count == most_sweeps:
                break
        pieces = first_piece[i + 1] - first_piece[i]
        for p in range(pieces):
            at = (p + 0.5) * length / pieces
            px, py = x1 + at * ux, y1 + at * uy
            looks = 0
            for q in range(count):
                k = near_by[q]
                verdict = look(
                    px, py, ux, uy, poses[k], cs[k], ss[k], ranges[starts[k] : starts[k + 1]],
                    sweeps[k, 0], sweeps[k, 1], reach, near, far,
                )  # fmt: skip
                if verdict != NOTHING:
                    said[looks] = verdict
                    looks += 1
                    if looks == most_looks:
                        break
            balance = 1.0
            for q in range(looks - 1, -1, -1):
                step = 1.0 if said[q] == SEEN else -loss
                balance = min(max(balance + step, 0.0), most)
            out[first_piece[i] + p] = balance
