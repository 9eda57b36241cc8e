"""Consistency of geometrical primitives and the consistency tables (§4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.edges import ANGLE, JUMP, NONE, Edges
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.primitives import Primitives

BoolTable = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ConsistencyTables:
    """T_{x x c} (Tables 4.1 and 4.2): rows are primitives of S_x, columns of S_c.

    lines: (|L_x|, |L_c|) bool. edges: (|E_x|, |E_c|) bool.
    """

    lines: BoolTable
    edges: BoolTable


def consistency_tables(x: Primitives, c: Primitives, windows: Windows) -> ConsistencyTables:
    """Build T_{x x c} for lines and edges (§4.1.3); T_{c x c} when both are the same scan."""
    lines = consistent_lines(x.L, c.L, windows)
    if windows.corners_bind_lines:
        lines &= ~contradicting_corners(x, c, windows)
    return ConsistencyTables(lines, consistent_edges(x.E, c.E, lines, windows))


def consistent_lines(x: LineSegments, c: LineSegments, windows: Windows) -> BoolTable:
    """Tell which line segments of S_x and S_c can be the same wall (§4.1.1): (|L_x|, |L_c|).

    All pairs by Algorithm 2: a complete line segment is the whole wall, so none that it is shorter
    than can match it.
    """
    return compare_lengths(
        x.lengths[:, None], x.is_complete[:, None], c.lengths, c.is_complete, windows.length
    )


def compare_lengths(
    length_k: NDArray[np.float64],
    complete_k: BoolTable,
    length_m: NDArray[np.float64],
    complete_m: BoolTable,
    tolerance: float,
) -> BoolTable:
    """Algorithm 2, CompareLengths, for arrays that broadcast; lengths and tolerance in metres.

    Departure: the printed algorithm calls a complete line segment a millimetre shorter than its
    like incompatible, against §4.1.1's "sufficiently close": equality is tested first.
    """
    equal = np.abs(length_k - length_m) <= tolerance
    shorter_is_complete = np.where(length_k < length_m, complete_k, complete_m)
    compatible: BoolTable = equal | ~shorter_is_complete
    return compatible


def consistent_edges(x: Edges, c: Edges, lines: BoolTable, windows: Windows) -> BoolTable:
    """Tell which edges of S_x and S_c can be the same corner (§4.1.2): (|E_x|, |E_c|).

    lines: T_{x x c}. Three criteria: the types, the angles between the two lines of each edge,
    and the line segments pair by pair, first with first and second with second.
    """
    return _types_agree(x, c) & _angles_agree(x, c, windows) & _lines_agree(x, c, lines)


def contradicting_corners(x: Primitives, c: Primitives, windows: Windows) -> BoolTable:
    """Tell which lines cannot match as they end in corners that differ: (|L_x|, |L_c|).

    §4.1.2: where edges i_(k,m) and i_(u,v) are not consistent, l_k cannot match with l_u, nor l_m
    with l_v. Departure: that holds of real corners at the same end whose angles differ; an edge
    that is inconsistent only through its other line (partly hidden) refutes nothing here.
    """
    refuted = np.zeros((len(x.L), len(c.L)), bool)
    real = np.isin(x.E.kind, (ANGLE, JUMP))[:, None] & np.isin(c.E.kind, (ANGLE, JUMP))
    differ = real & ~_angles_agree(x.E, c.E, windows)
    for side in (0, 1):
        i, j = np.nonzero(differ)
        u, k = x.E.lines[i, side], c.E.lines[j, side]
        both = (u != NONE) & (k != NONE)
        refuted[u[both], k[both]] = True
    return refuted


def _types_agree(x: Edges, c: Edges) -> BoolTable:
    """An angle edge can be an angle or a jump edge, a virtual edge only a virtual one."""
    kx, kc = x.kind[:, None], c.kind
    corner: BoolTable = np.isin(kx, (ANGLE, JUMP)) & np.isin(kc, (ANGLE, JUMP))
    agree: BoolTable = corner | (kx == kc)
    return agree


def _angles_agree(x: Edges, c: Edges, windows: Windows) -> BoolTable:
    """beta_(k,m) = beta_(u,v), or within the bounds of what a jump edge's may be (Fig. 4.2(b))."""
    apart = np.abs(wrap_array(x.beta[:, None] - c.beta))
    within: BoolTable = apart <= windows.angle + x.beta_slack[:, None] + c.beta_slack
    return within


def _lines_agree(x: Edges, c: Edges, lines: BoolTable) -> BoolTable:
    """Are all lines that both edges have consistent, and is there one?

    Departure: two jump edges of which one has only its first line and the other only its second
    are compared by nothing and tell nothing about any pair of lines: not consistent.
    """
    agree = np.ones((len(x), len(c)), bool)
    shared = np.zeros((len(x), len(c)), bool)
    for side in (0, 1):
        u, k = x.lines[:, side], c.lines[:, side]
        both = (u != NONE)[:, None] & (k != NONE)
        shared |= both
        if lines.size:
            agree &= ~both | lines[u[:, None], k]
    return agree & shared
