"""Numba kernels on one hypothesis: a row of COLUMNS numbers.

x, y, theta, explained, votes, matched, conflict, occluded, outside, overlap, information (upper
triangle of the refinement's H, row by row). Metres of wall from `matched` to `overlap`.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel
from lineloom_core.matching._proposal_kernels import wrap_angle

COLUMNS = 16
MATCHED, CONFLICT, OCCLUDED, OUTSIDE, OVERLAP, INFORMATION = 5, 6, 7, 8, 9, 10
OVERLAP_WEIGHT, CONFLICT_WEIGHT = 0.25, 2.5
"""Of overlapping lines and of conflicts beside what is matched (chosen on simulated pairs)."""


@kernel
def evidence(row):  # type: ignore[no-untyped-def]
    """What speaks for a hypothesis, in metres of wall: matched and overlap, less conflicts."""
    return row[MATCHED] + OVERLAP_WEIGHT * row[OVERLAP] - CONFLICT_WEIGHT * row[CONFLICT]


@kernel
def fill_row(out, pose, explained, votes, counts, overlap, H):  # type: ignore[no-untyped-def]
    """Write a hypothesis."""
    out[:3] = pose
    out[3], out[4] = explained, votes
    out[5:9] = counts
    out[9] = overlap
    out[10], out[11], out[12] = H[0, 0], H[0, 1], H[0, 2]
    out[13], out[14], out[15] = H[1, 1], H[1, 2], H[2, 2]


@kernel
def is_known(table, kept, pose):  # type: ignore[no-untyped-def]
    """Has one of the first `kept` rows nearly this pose already?"""
    for k in range(kept):
        near = math.hypot(table[k, 0] - pose[0], table[k, 1] - pose[1]) < 0.08
        if near and abs(wrap_angle(table[k, 2] - pose[2])) < 0.03:
            return True
    return False


@kernel
def translation_information(a, b, c, d, e, f):  # type: ignore[no-untyped-def]
    """Least eigenvalue [1/m^2] of the translation's Schur complement, and its direction [rad].

    Arguments: upper triangle of the information matrix, row by row. Direction in 0..pi.
    """
    f = max(f, 1e-9)
    xx, xy, yy = a - c * c / f, b - c * e / f, d - e * e / f
    least = 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy)
    strong = 0.5 * math.atan2(2.0 * xy, xx - yy)  # the axis of the greater eigenvalue
    return least, np.mod(strong + 0.5 * math.pi, math.pi)


@kernel
def turn_information(a, b, c, d, e, f):  # type: ignore[no-untyped-def]
    """Information [1/rad^2] of the rotation while the translation is not known."""
    a, d = a + 0.01, d + 0.01  # where nothing fixes a translation it says nothing of the rotation
    det = a * d - b * b
    return f - (d * c * c - 2.0 * b * c * e + a * e * e) / det
