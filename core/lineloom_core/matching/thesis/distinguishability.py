"""Distinguishability: relations that are rare in both scans count more (§5.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.consistency import BoolTable, ConsistencyTables
from lineloom_core.matching.thesis.edges import NONE
from lineloom_core.matching.thesis.near_pairs import Indices
from lineloom_core.matching.thesis.relations import Relations, RelationSet

Matches = tuple[Indices, Indices]
"""Index pairs (g_c, g_x) of matching relations of one kind."""


def matching_relations(
    G_c: RelationSet, G_x: RelationSet, tables: ConsistencyTables, windows: Windows
) -> tuple[Matches, ...]:
    """All g_x that match with each g_c, kind by kind (L, A, P, E).

    The inner test of Algorithms 3 and 4: geometrical parameters consistent, and all lines
    consistent by T_{x x c}.
    """
    matches = []
    for c, x in zip(G_c.kinds, G_x.kinds, strict=True):
        i, j = c.compatible(x, tables, windows)
        consistent = lines_consistent(c, i, x, j, tables.lines)
        matches.append((i[consistent], j[consistent]))
    return tuple(matches)


def lines_consistent(
    c: Relations, i: Indices, x: Relations, j: Indices, lines: BoolTable
) -> NDArray[np.bool_]:
    """Is T_{x x c}(l_i, l_j) = 1 for all corresponding lines of relations c_i and x_j? (q,)

    A line that either relation lacks (jump edge) corresponds to none.
    """
    rows, columns = x.lines[j], c.lines[i]
    if not lines.size:
        return np.zeros(len(i), bool)
    consistent = lines[rows, columns] | (rows == NONE) | (columns == NONE)
    all_lines: NDArray[np.bool_] = consistent.all(axis=1)
    return all_lines


def count(G_c: RelationSet, matches: tuple[Matches, ...]) -> tuple[NDArray[np.int64], ...]:
    """Algorithm 3: Count(g_c, G_x, T_{x x c}) for all g_c of each kind, (|kind|,) each."""
    return tuple(
        np.bincount(i, minlength=len(kind)).astype(np.int64)
        for kind, (i, _) in zip(G_c.kinds, matches, strict=True)
    )


def distinguishability(
    count_c: NDArray[np.int64], count_r: NDArray[np.int64]
) -> NDArray[np.float64]:
    """score = 1 / (Count(g_c, G_c) Count(g_c, G_r)), (n,) (§5.1).

    Departure: 0 where g_c appears in neither, instead of a division by zero (Algorithm 4 also
    lacks the parentheses).
    """
    product = (count_c * count_r).astype(np.float64)
    return np.divide(1.0, product, out=np.zeros_like(product), where=product > 0.0)
