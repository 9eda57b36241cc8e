"""Finding matching line segments in the matching table (§5.3 to §5.5, §5.7)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import angle_difference
from lineloom_core.matching.thesis.config import ThesisConfig
from lineloom_core.matching.thesis.matching_table import MatchingTable
from lineloom_core.matching.thesis.primitives import Primitives

Match = tuple[int, int]
"""Extraction numbers (k, m) of matching line segments, l_k in L_r and l_m in L_c."""


@dataclass(frozen=True, eq=False)
class MatchingPairs:
    """What Algorithm 5 found.

    pairs: in the order of discovery. scores: their merged scores in the end (Table 5.2).
    table: the table that is left.
    """

    pairs: tuple[Match, ...]
    scores: tuple[float, ...]
    table: MatchingTable

    @property
    def total(self) -> float:
        """Sum of the matched lines' merged scores."""
        return math.fsum(self.scores)


def find_matching_line_segments(
    table: MatchingTable,
    r: Primitives,
    c: Primitives,
    config: ThesisConfig,
    first: Match | None = None,
) -> MatchingPairs:
    """Algorithm 5, FindMatchingLineSegments; `table` is left as it was.

    The first maximum fixes the rotation, or `first` where another start is wanted (the text has
    none). Departures: l_k is the reference's line and l_m the current one's throughout; a pair
    whose rotation differs loses its scores, as printed; the threshold, which the text leaves open,
    is 0.5.
    """
    table = table.copy()
    pairs: list[Match] = []
    k, m, maximum = _starting_at(table, first) or table.find_maximum_score(pairs)
    best_match_angle = beta(r, k, c, m) if maximum > 0.0 else 0.0
    current_angle = best_match_angle
    while maximum > config.threshold:
        if abs(angle_difference(best_match_angle, current_angle)) <= config.windows.angle:
            pairs.append((k, m))
            _eliminate_incorrect_matches(table, pairs, r, c, config)
        else:
            rejected = np.zeros(table.shape, bool)
            rejected[k, m] = True
            table.invalidate(rejected)
        k, m, maximum = table.find_maximum_score(pairs)
        current_angle = beta(r, k, c, m) if maximum > 0.0 else 0.0
    return MatchingPairs(tuple(pairs), tuple(float(table.merged[p]) for p in pairs), table)


def beta(r: Primitives, k: int, c: Primitives, m: int) -> float:
    """Rotational difference of l_k in L_r and l_m in L_c: what turns l_m onto l_k [rad]."""
    return angle_difference(float(r.L.directions[k]), float(c.L.directions[m]))


def _starting_at(table: MatchingTable, first: Match | None) -> tuple[int, int, float] | None:
    return None if first is None else (*first, float(table.merged[first]))


def _eliminate_incorrect_matches(
    table: MatchingTable, pairs: list[Match], r: Primitives, c: Primitives, config: ThesisConfig
) -> None:
    """Algorithm 7, or with the order extension Algorithm 10, for the latest pair.

    Departure: a full turn has no first line, so order there is counted from the first match on.
    """
    k, m = pairs[-1]
    if not config.order_extension:
        table.mark_invalid_scores(k, m)
        return
    full_turn = r.full_turn and c.full_turn
    row_rank = _ranks(len(r.L), pairs[0][0] if full_turn else 0)
    column_rank = _ranks(len(c.L), pairs[0][1] if full_turn else 0)
    if full_turn and len(pairs) == 1:
        table.mark_invalid_scores(k, m)  # a first match orders nothing on a circle
        return
    table.mark_invalid_scores_by_order(k, m, row_rank, column_rank)


def _ranks(count: int, start: int) -> NDArray[np.int64]:
    """Places in the order of extraction, counted from line `start` around the turn: (count,)."""
    return np.mod(np.arange(count) - start, max(count, 1)).astype(np.int64)
