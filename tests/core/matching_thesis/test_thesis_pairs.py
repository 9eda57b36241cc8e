"""Algorithm 5: matching line segments out of the matching table (thesis §5.3, Tables 5.1, 5.2)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.matching.thesis import Primitives, ThesisConfig
from lineloom_core.matching.thesis.edges import ANGLE, NONE, Edges
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.matching_table import MatchingTable
from lineloom_core.matching.thesis.pairs import find_matching_line_segments

TABLE_5_1 = np.array(
    [
        [0.00, 0.00, 0.00, 0.46, 0.00, 0.00, 0.00, 0.03],
        [5.61, 0.00, 0.00, 0.00, 0.00, 0.00, 0.00, 0.14],
        [0.00, 9.75, 0.00, 0.00, 0.00, 0.00, 0.00, 0.00],
        [1.28, 0.00, 0.00, 0.00, 0.00, 0.00, 0.25, 0.14],
        [0.00, 0.00, 0.00, 0.00, 1.92, 7.50, 0.00, 0.00],
        [0.00, 1.58, 1.17, 1.68, 0.58, 1.50, 2.25, 0.20],
        [0.00, 0.00, 0.00, 0.07, 0.00, 0.00, 6.25, 1.31],
        [0.11, 0.00, 0.17, 0.00, 0.00, 0.00, 0.92, 1.87],
    ]
)
TABLE_5_2 = {(1, 0): 4.82, (2, 1): 8.08, (4, 5): 7.12, (6, 6): 5.33}
TURN = 0.9


def lines(degrees: list[float]) -> Primitives:
    t = np.radians(degrees)
    start = np.column_stack([np.arange(len(t)), -np.arange(len(t))]).astype(float)
    rows = np.hstack([start, start + np.column_stack([np.cos(t), np.sin(t)])])
    return Primitives(LineSegments.of(rows), Edges.of(ANGLE, [], [], []))


def scans_of_figure_5_2() -> tuple[Primitives, Primitives]:
    """l_1, l_2, l_6, l_7 of S_c are l_2, l_3, l_5, l_7 of S_r; l_8 and l_8 are turned apart."""
    r = [10.0, 0.0, 90.0, 0.0, 180.0, 90.0, 270.0, 30.0]
    c = [0.0, 90.0, 45.0, 20.0, 60.0, 180.0, 270.0, 70.0]
    return lines([x + math.degrees(TURN) for x in r]), lines(c)


def tables_5_1() -> MatchingTable:
    """Table 5.1 from scores of which some are shared with cells that turn out wrong.

    What Table 5.2 lacks of Table 5.1 stood in the lists of wrong cells as well.
    """
    shared = {(1, 0): (3, 0), (2, 1): (5, 1), (4, 5): (5, 5), (6, 6): (5, 6)}
    own = TABLE_5_1.copy()
    scores, cells = [], []
    for (i, j), left in TABLE_5_2.items():
        # What the one wrong cell cannot hold is shared with (l_8, l_8).
        parts = [(shared[i, j], min(TABLE_5_1[i, j] - left, own[shared[i, j]]))]
        parts.append(((7, 7), TABLE_5_1[i, j] - left - parts[0][1]))
        for wrong, lost in parts:
            if lost > 1e-9:
                scores.append(lost)
                cells.append([8 * i + j, 8 * wrong[0] + wrong[1], NONE, NONE])
                own[i, j] -= lost
                own[wrong] -= lost
    for i, j in np.argwhere(own > 1e-9).tolist():
        scores.append(own[i, j])
        cells.append([8 * i + j, NONE, NONE, NONE])
    return MatchingTable.of((8, 8), np.array(scores), np.array(cells))


def test_tables_5_1_and_5_2() -> None:
    """With the order extension (§5.7), as the zeros of Table 5.2 show."""
    table = tables_5_1()
    assert table.merged == pytest.approx(TABLE_5_1, abs=1e-9)
    r, c = scans_of_figure_5_2()
    found = find_matching_line_segments(table, r, c, ThesisConfig(order_extension=True))
    assert found.pairs == ((2, 1), (4, 5), (6, 6), (1, 0))  # by falling score
    expected = np.zeros((8, 8))
    for cell, score in TABLE_5_2.items():
        expected[cell] = score
    assert found.table.merged == pytest.approx(expected, abs=1e-9)
    assert found.total == pytest.approx(4.82 + 8.08 + 7.12 + 5.33)
    assert table.merged == pytest.approx(TABLE_5_1, abs=1e-9)  # left as it was


def test_without_the_order_extension() -> None:
    """The same pairs; Algorithm 7 alone leaves cells outside of matched rows and columns."""
    r, c = scans_of_figure_5_2()
    found = find_matching_line_segments(tables_5_1(), r, c, ThesisConfig())
    assert set(found.pairs) == set(TABLE_5_2)
    rest = found.table.merged.copy()
    rest[tuple(np.array(list(TABLE_5_2)).T)] = 0.0
    assert np.all(rest <= ThesisConfig().threshold)
    rows, columns = [k for k, _ in found.pairs], [m for _, m in found.pairs]
    assert not rest[rows].any()
    assert not rest[:, columns].any()


def single(scores: dict[tuple[int, int], float], shape: tuple[int, int]) -> MatchingTable:
    cells = [[i * shape[1] + j, NONE, NONE, NONE] for i, j in scores]
    return MatchingTable.of(shape, np.array(list(scores.values())), np.array(cells))


def test_the_first_maximum_fixes_the_rotation() -> None:
    r, c = lines([30.0, 120.0, 240.0]), lines([0.0, 90.0, 200.0])
    table = single({(0, 0): 3.0, (1, 1): 2.0, (2, 2): 2.5}, (3, 3))
    found = find_matching_line_segments(table, r, c, ThesisConfig())
    assert found.pairs == ((0, 0), (1, 1))  # (2, 2) is turned by 40 degrees, not 30
    assert found.table.merged[2, 2] == 0.0  # and has lost its scores
    other = find_matching_line_segments(table, r, c, ThesisConfig(), first=(2, 2))
    assert other.pairs == ((2, 2),)


def test_a_rejected_pair_takes_shared_scores_along() -> None:
    r, c = lines([0.0, 90.0, 200.0]), lines([0.0, 90.0, 230.0])
    cells = np.array(
        [[0, NONE, NONE, NONE], [4, 8, NONE, NONE], [8, NONE, NONE, NONE], [4, NONE, NONE, NONE]]
    )
    table = MatchingTable.of((3, 3), np.array([4.0, 1.0, 2.0, 0.8]), cells)
    found = find_matching_line_segments(table, r, c, ThesisConfig())
    assert found.pairs == ((0, 0), (1, 1))
    assert found.scores == pytest.approx((4.0, 0.8))


def test_nothing_over_the_threshold() -> None:
    r, c = lines([0.0, 90.0]), lines([0.0, 90.0])
    weak = single({(0, 0): 0.4, (1, 1): 0.3}, (2, 2))
    assert find_matching_line_segments(weak, r, c, ThesisConfig()).pairs == ()
    nothing = MatchingTable.of((2, 2), np.empty(0), np.empty((0, 4), np.int64))
    assert find_matching_line_segments(nothing, r, c, ThesisConfig()).pairs == ()


def test_order_on_a_full_turn_starts_at_the_first_match() -> None:
    """A scan that begins two lines later sees 2, 3, 0, 1: cyclic order is kept (departure)."""
    angles = [0.0, 90.0, 180.0, 270.0]
    pairs = {(2, 0): 4.0, (3, 1): 3.0, (0, 2): 2.0, (1, 3): 1.0}
    r, c = lines(angles), lines(angles[2:] + angles[:2])
    config = ThesisConfig(order_extension=True)
    assert len(find_matching_line_segments(single(pairs, (4, 4)), r, c, config).pairs) == 2
    r, c = (Primitives(p.L, p.E, full_turn=True) for p in (r, c))
    found = find_matching_line_segments(single(pairs, (4, 4)), r, c, config)
    assert found.pairs == tuple(pairs)
