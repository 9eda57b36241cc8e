"""Consistency of primitives and the consistency tables (thesis §4.1, Fig. 4.1, 4.2, Tables 4.x)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching.thesis import Primitives, Windows, extract_primitives
from lineloom_core.matching.thesis.consistency import (
    consistency_tables,
    consistent_edges,
    consistent_lines,
)
from lineloom_core.matching.thesis.edges import ANGLE, JUMP, NONE, VIRTUAL, Edges
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_lab.simulation import sick_lms200, world_named

WINDOWS = Windows()
E, I = True, False  # noqa: E741 edge point, interior point


def lines_of(lengths: list[float], ends: list[tuple[bool, bool]]) -> LineSegments:
    rows = [[0.0, -float(i) - 1.0, length, -float(i) - 1.0] for i, length in enumerate(lengths)]
    return LineSegments.of(rows, ends)


def compare_lengths_twin(
    length_k: float, complete_k: bool, length_m: float, complete_m: bool, tolerance: float
) -> bool:
    """Algorithm 2 line by line, equality first."""
    if abs(length_k - length_m) <= tolerance:
        return True
    shorter_is_complete = complete_k if length_k < length_m else complete_m
    return not shorter_is_complete


def test_figure_4_1() -> None:
    """l_2 of S_c is consistent with l_1, l_3, l_5 and l_6 of S_r alone."""
    l_2 = lines_of([2.0], [(E, E)])
    r = lines_of(
        [1.2, 3.0, 2.0, 3.5, 2.0, 1.5, 2.8, 4.0],
        [(I, E), (E, E), (E, E), (I, E), (E, E), (I, E), (E, I), (I, I)],
    )
    table = consistent_lines(r, l_2, WINDOWS)
    assert (np.flatnonzero(table[:, 0]) + 1).tolist() == [1, 3, 5, 6]


def test_the_three_criteria() -> None:
    c = lines_of([2.0, 2.0], [(E, E), (E, I)])
    r = lines_of([2.05, 1.0, 1.0, 3.0], [(E, E), (E, E), (I, E), (E, E)])
    table = consistent_lines(r, c, WINDOWS)
    assert table[:, 0].tolist() == [True, False, True, False]
    assert table[:, 1].tolist() == [True, False, True, True]


def test_a_millimetre_makes_no_wall_another() -> None:
    """As printed, Algorithm 2 would refuse this pair (departure)."""
    assert consistent_lines(lines_of([2.0], [(E, E)]), lines_of([1.999], [(E, E)]), WINDOWS)[0, 0]


@pytest.mark.parametrize("seed", range(3))
def test_algorithm_2_against_its_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sets = []
    for n in (7, 9):
        ends = [(bool(a), bool(b)) for a, b in rng.random((n, 2)) < 0.6]
        sets.append(lines_of(rng.uniform(0.3, 2.0, n).tolist(), ends))
    x, c = sets
    table = consistent_lines(x, c, WINDOWS)
    for k in range(7):
        for m in range(9):
            assert table[k, m] == compare_lengths_twin(
                x.lengths[k], x.is_complete[k], c.lengths[m], c.is_complete[m], WINDOWS.length
            )


def corner(beta_deg: float, lines: tuple[int, int] = (0, 1), kind: int = ANGLE) -> Edges:
    return Edges.of(kind, [[0.0, 0.0]], [lines], [[0.0, math.radians(beta_deg)]])


def jump(low_deg: float, high_deg: float, lines: tuple[int, int]) -> Edges:
    middle, slack = math.radians(low_deg + high_deg) / 2, math.radians(high_deg - low_deg) / 2
    if lines[1] == NONE:
        return Edges.of(JUMP, [[0.0, 0.0]], [lines], [[0.0, middle]], [[0.0, slack]])
    return Edges.of(JUMP, [[0.0, 0.0]], [lines], [[-middle, 0.0]], [[slack, 0.0]])


def test_figure_4_2() -> None:
    """i_(1,2) is consistent with the like corner, not with the jump edge, not with the convex one.

    The beam past e_6 leaves for a line that starts there only what turns back into the shadow:
    beta between 180 and some 250 degrees, never the 90 of i_(1,2).
    """
    c = corner(90.0)
    r = Edges.joined([corner(92.0, (2, 3)), jump(180.0, 250.0, (6, NONE)), corner(270.0, (7, 8))])
    all_lines = np.ones((9, 2), bool)
    assert consistent_edges(r, c, all_lines, WINDOWS)[:, 0].tolist() == [True, False, False]


def test_an_angle_edge_can_be_a_jump_edge_from_elsewhere() -> None:
    all_lines = np.ones((9, 2), bool)
    for beta, expected in ((200.0, True), (254.0, True), (260.0, False), (90.0, False)):
        for lines in ((6, NONE), (NONE, 6)):
            table = consistent_edges(jump(180.0, 250.0, lines), corner(beta), all_lines, WINDOWS)
            assert bool(table[0, 0]) is expected, (beta, lines)


def test_virtual_edges_compare_with_their_kind_only() -> None:
    all_lines = np.ones((2, 2), bool)
    virtual = corner(90.0, kind=VIRTUAL)
    assert consistent_edges(virtual, virtual, all_lines, WINDOWS)[0, 0]
    assert not consistent_edges(virtual, corner(90.0), all_lines, WINDOWS)[0, 0]


def test_lines_of_consistent_edges_are_consistent() -> None:
    lines = np.array([[True, True], [True, False]])  # l_1 of x is not l_1 of c
    assert not consistent_edges(corner(90.0), corner(90.0), lines, WINDOWS)[0, 0]
    one_line = jump(180.0, 250.0, (0, NONE))
    assert consistent_edges(one_line, corner(200.0), lines, WINDOWS)[0, 0]


def test_jump_edges_without_a_common_line_tell_nothing() -> None:
    first, second = jump(180.0, 250.0, (0, NONE)), jump(180.0, 250.0, (NONE, 0))
    assert not consistent_edges(first, second, np.ones((2, 2), bool), WINDOWS)[0, 0]
    assert consistent_edges(first, first, np.ones((2, 2), bool), WINDOWS)[0, 0]


def test_corners_that_differ_can_bind_their_lines() -> None:
    """The last sentence of §4.1.2 taken at its word, as an option."""
    lines = LineSegments.of([[0, -1, 2, -1], [2, -1, 2, 1]], [(I, E), (E, I)])
    concave, convex = Primitives(lines, corner(90.0)), Primitives(lines, corner(270.0))
    assert consistency_tables(concave, convex, WINDOWS).lines.all()
    bound = consistency_tables(concave, convex, Windows(corners_bind_lines=True)).lines
    assert bound.tolist() == [[False, True], [True, False]]


@pytest.mark.parametrize("seed", range(4))
def test_a_scan_against_itself(seed: int) -> None:
    """Table 4.2: symmetric, and every line is consistent with itself."""
    rng = np.random.default_rng(seed)
    scan = sick_lms200().scan(world_named("rooms", 1), Pose(2.0, 2.0, 0.5 * seed), rng)
    found = extract_primitives(scan)
    tables = consistency_tables(found, found, WINDOWS)
    assert tables.lines.shape == (len(found.L), len(found.L))
    assert np.array_equal(tables.lines, tables.lines.T)
    assert tables.lines.diagonal().all()
    assert np.array_equal(tables.edges, tables.edges.T)
    assert tables.edges.diagonal().all()
