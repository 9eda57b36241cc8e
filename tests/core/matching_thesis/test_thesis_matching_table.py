"""Distinguishability and the matching table (thesis §5.1, §5.2, §5.4, §5.5, §5.7)."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching.thesis import ThesisConfig, ThesisMatcher, Windows
from lineloom_core.matching.thesis.consistency import consistency_tables
from lineloom_core.matching.thesis.distinguishability import (
    count,
    distinguishability,
    matching_relations,
)
from lineloom_core.matching.thesis.edges import NONE
from lineloom_core.matching.thesis.matcher import Description
from lineloom_core.matching.thesis.matching_table import MatchingTable, compute_scores
from lineloom_lab.simulation import sick_lms200, world_named
from numpy.typing import NDArray

WINDOWS = Windows()


def table_of(
    shape: tuple[int, int], scores: list[tuple[float, list[tuple[int, int]]]]
) -> MatchingTable:
    """A table whose scores stand in the lists of the given cells."""
    cells = np.full((len(scores), 4), NONE)
    for n, (_, where) in enumerate(scores):
        cells[n, : len(where)] = [i * shape[1] + j for i, j in where]
    return MatchingTable.of(shape, np.array([s for s, _ in scores]), cells)


def described(seed: int, pose: Pose) -> Description:
    scan = sick_lms200().scan(world_named("rooms", 2), pose, np.random.default_rng(seed))
    return ThesisMatcher().describe(ThesisMatcher(ThesisConfig()).prepare(scan).primitives)


def test_distinguishability() -> None:
    """1 / (Count in S_c x Count in S_r), and nothing for a relation that is nowhere."""
    score = distinguishability(np.array([1, 2, 1, 3]), np.array([1, 1, 4, 0]))
    assert score.tolist() == [1.0, 0.5, 0.25, 0.0]


def test_figure_5_1() -> None:
    """Score 4 stands in both lists: when l_i does not match l_j, it is gone from the other too."""
    ij, km = (0, 0), (1, 1)
    table = table_of((2, 2), [(0.50, [ij]), (0.06, [km]), (0.10, [km]), (0.25, [ij, km])])
    assert table.merged[ij] == pytest.approx(0.75)
    assert table.merged[km] == pytest.approx(0.41)
    assert table.list_at(*ij).tolist() == [0, 3]
    wrong = np.zeros((2, 2), bool)
    wrong[ij] = True
    table.invalidate(wrong)
    assert table.merged[ij] == 0.0
    assert table.merged[km] == pytest.approx(0.16)
    assert table.is_valid.tolist() == [False, True, True, False]
    assert table.list_at(*ij).tolist() == [0, 3]  # the list still holds them, invalid


def test_a_copy_is_independent() -> None:
    table = table_of((1, 2), [(1.0, [(0, 0), (0, 1)])])
    other = table.copy()
    other.invalidate(np.array([[True, False]]))
    assert table.merged.tolist() == [[1.0, 1.0]]
    assert other.merged.tolist() == [[0.0, 0.0]]


def test_algorithm_6_skips_what_is_matched() -> None:
    table = table_of((2, 3), [(3.0, [(0, 1)]), (2.0, [(1, 2)]), (2.0, [(0, 0)])])
    assert table.find_maximum_score([]) == (0, 1, 3.0)
    assert table.find_maximum_score([(0, 1)]) == (0, 0, 2.0)  # the first of equals, row by row
    assert table.find_maximum_score([(0, 1), (0, 0), (1, 2)])[2] == 0.0


def each_cell(rows: int, columns: int) -> MatchingTable:
    return table_of((rows, columns), [(1.0, [(i, j)]) for i in range(rows) for j in range(columns)])


def test_algorithm_7_clears_row_and_column() -> None:
    table = each_cell(4, 5)
    table.mark_invalid_scores(1, 3)
    left = np.ones((4, 5))
    left[1, :] = left[:, 3] = 0.0
    left[1, 3] = 1.0
    assert np.array_equal(table.merged, left)


def test_algorithm_10_clears_what_would_break_the_order() -> None:
    """Only lines both before or both after the match can still match."""
    table = each_cell(4, 5)
    table.mark_invalid_scores_by_order(1, 3, np.arange(4), np.arange(5))
    left = np.zeros((4, 5))
    left[:1, :3] = left[2:, 4:] = left[1, 3] = 1.0
    assert np.array_equal(table.merged, left)


@pytest.mark.parametrize("seed", range(3))
def test_elimination_against_the_printed_loops(seed: int) -> None:
    """Algorithms 6, 7 and 10 on lists of scoreIDs, as printed."""
    rng = np.random.default_rng(seed)
    shape = (5, 6)
    scores = [
        (float(rng.random()), [tuple(rng.integers(0, shape).tolist()) for _ in range(2)])
        for _ in range(60)
    ]
    scores = [(s, list(dict.fromkeys(where))) for s, where in scores]
    lists = {
        (i, j): [n for n, (_, w) in enumerate(scores) if (i, j) in w]
        for i in range(5)
        for j in range(6)
    }

    def merged(valid: list[bool]) -> NDArray[np.float64]:
        table = np.zeros(shape)
        for cell, ids in lists.items():
            table[cell] = sum(scores[n][0] for n in ids if valid[n])
        return table

    for order in (False, True):
        table = table_of(shape, scores)
        k, m, best = table.find_maximum_score([])
        assert best == pytest.approx(merged([True] * 60).max())
        valid = [True] * 60
        for (i, j), ids in lists.items():
            by_7 = (i == k) != (j == m)
            by_10 = ((i <= k and j >= m) or (i >= k and j <= m)) and (i, j) != (k, m)
            for n in ids:
                valid[n] = valid[n] and not (by_10 if order else by_7)
        if order:
            table.mark_invalid_scores_by_order(k, m, np.arange(5), np.arange(6))
        else:
            table.mark_invalid_scores(k, m)
        assert table.merged == pytest.approx(merged(valid))
        assert table.is_valid.tolist() == valid


def relation_pairs(c: Description, r: Description) -> list[tuple[int, int, int]]:
    """All (kind, g_c, g_r) that match, by the loops of Algorithm 3."""
    tables = consistency_tables(r.primitives, c.primitives, WINDOWS)
    found = []
    for kind, (G_c, G_r) in enumerate(zip(c.G.kinds, r.G_any.kinds, strict=True)):
        compatible = set(
            zip(*(x.tolist() for x in G_c.compatible(G_r, tables, WINDOWS)), strict=True)
        )
        for g_c in range(len(G_c)):
            for g_r in range(len(G_r)):
                is_consistent = True
                for j, i in zip(G_c.lines[g_c], G_r.lines[g_r], strict=True):
                    if NONE not in (i, j) and not tables.lines[i, j]:
                        is_consistent = False
                if is_consistent and (g_c, g_r) in compatible:
                    found.append((kind, g_c, g_r))
    return found


def test_algorithms_3_and_4_against_the_printed_loops() -> None:
    c, r = described(0, Pose(2.5, 2.0, 0.3)), described(1, Pose(2.7, 2.1, 0.5))
    tables = consistency_tables(r.primitives, c.primitives, WINDOWS)
    matches = relation_pairs(c, r)
    self_matches = relation_pairs(c, c)
    counts = count(c.G, matching_relations(c.G, r.G_any, tables, WINDOWS))
    for kind in range(4):
        expected = [sum(m[:2] == (kind, g) for m in matches) for g in range(len(c.G.kinds[kind]))]
        assert counts[kind].tolist() == expected
        own = [sum(m[:2] == (kind, g) for m in self_matches) for g in range(len(c.G.kinds[kind]))]
        assert c.counts[kind].tolist() == own
        assert min(own, default=1) >= 1  # every relation matches itself

    merged = np.zeros(tables.lines.shape)
    for kind, g_c, g_r in matches:
        score = 1.0 / (c.counts[kind][g_c] * counts[kind][g_c])
        rows, columns = r.G_any.kinds[kind].lines[g_r], c.G.kinds[kind].lines[g_c]
        cells = {(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if NONE not in (i, j)}
        for cell in cells:  # once, even where two edges share a line
            merged[cell] += score
    table = compute_scores(c.G, r.G_any, c.counts, tables, WINDOWS)
    assert table.merged == pytest.approx(merged)
    assert len(table.score) == len(matches)  # one scoreID per match: more than |G_c|
    assert table.is_valid.all()


def test_true_pairs_have_the_greatest_scores() -> None:
    """Table 5.1: the merged scores of lines that really match exceed the others."""
    c, r = described(0, Pose(2.5, 2.0, 0.3)), described(1, Pose(2.5, 2.0, 0.3))
    tables = consistency_tables(r.primitives, c.primitives, WINDOWS)
    table = compute_scores(c.G, r.G_any, c.counts, tables, WINDOWS)
    L_c, L_r = c.primitives.L, r.primitives.L
    apart = np.hypot(*np.moveaxis(L_r.s[:, None] - L_c.s, 2, 0))
    truth = np.where(apart.min(axis=0) < 0.1, apart.argmin(axis=0), -1)  # seen from one place
    found = table.merged.argmax(axis=0)
    assert np.mean((found == truth)[truth >= 0]) > 0.8
    assert int((truth >= 0).sum()) >= 8
