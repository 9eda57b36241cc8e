"""The four geometrical relations and their comparisons (thesis chapter 4, Fig. 4.3 to 4.8)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.thesis import Primitives, Windows, extract_primitives
from lineloom_core.matching.thesis.angle_relation import AngleRelations, relative_angle
from lineloom_core.matching.thesis.consistency import ConsistencyTables, consistency_tables
from lineloom_core.matching.thesis.edge_relation import EdgeRelations
from lineloom_core.matching.thesis.edges import ANGLE, JUMP, NONE, Edges
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.near_pairs import near_pairs
from lineloom_core.matching.thesis.parallel_relation import (
    MAY_OVERLAP,
    NO_OVERLAP,
    OVERLAP,
    ParallelRelations,
)
from lineloom_core.matching.thesis.relations import RelationSet, extract_relations
from lineloom_lab.simulation import sick_lms200, world_named

WINDOWS = Windows()
E, I = True, False  # noqa: E741 edge point, interior point
ANY = ConsistencyTables(np.ones((9, 9), bool), np.ones((9, 9), bool))


# Angle between two line segments (§4.3)


def test_figures_4_3_and_4_4() -> None:
    """Seen from l_2, l_1 lies at 270 degrees, l_3 at 90, l_4 at 0 and l_7 at 180; no slope can
    tell the first two, or the last two, from each other.
    """
    heading = 0.3  # the scan's own frame does not matter
    turn = {1: -90.0, 2: 0.0, 3: 90.0, 4: 0.0, 5: 90.0, 6: 0.0, 7: 180.0, 8: 270.0}
    rows = []
    for i, degrees in turn.items():
        start = np.array([float(i), -2.0 * i])
        u = np.array(
            [math.cos(heading + math.radians(degrees)), math.sin(heading + math.radians(degrees))]
        )
        rows.append([*start, *(start + u)])
    L = LineSegments.of(rows)
    beta = np.degrees(relative_angle(L.directions[1], L.directions))
    assert [round(float(beta[i - 1])) % 360 for i in (1, 3, 4, 7)] == [270, 90, 0, 180]


def test_the_ends_are_put_together_and_the_reference_on_the_positive_axis() -> None:
    """Fig. 4.4 to the letter: l_k from (+, 0) to the origin, then the angle of l_m's start."""
    rng = np.random.default_rng(0)
    L = LineSegments.of(rng.uniform(-5.0, 5.0, (8, 4)))
    for k in range(8):
        for m in range(8):
            to_start_k, to_start_m = L.s[k] - L.e[k], L.s[m] - L.e[m]
            aligned = Pose(0.0, 0.0, -math.atan2(to_start_k[1], to_start_k[0])).transform(
                to_start_m
            )
            expected = math.atan2(aligned[1], aligned[0]) % math.tau
            apart = wrap_array(relative_angle(L.directions[k], L.directions[m]) - expected)
            assert float(apart) == pytest.approx(0.0, abs=1e-9)


def test_angles_are_equal_around_the_turn() -> None:
    a = AngleRelations(np.array([[0, 1]]), np.array([math.radians(359.0)]))
    b = AngleRelations(np.tile([0, 1], (3, 1)), np.radians([2.0, 354.5, 10.0]))
    i, j = a.compatible(b, ANY, WINDOWS)
    assert i.tolist() == [0, 0]
    assert sorted(j.tolist()) == [0, 1]


def test_both_orders_are_an_option() -> None:
    L = LineSegments.of([[0, 0, 1, 0], [1, 0, 1, 1], [0, 1, 1, 2]])
    ascending, both = AngleRelations.of(L, False), AngleRelations.of(L, True)
    assert ascending.lines.tolist() == [[0, 1], [0, 2], [1, 2]]
    assert both.lines.tolist()[3:] == [[1, 0], [2, 0], [2, 1]]
    assert np.mod(both.beta[:3] + both.beta[3:], math.tau) == pytest.approx(np.zeros(3), abs=1e-9)


# Parallel line distance (§4.4)


def parallel(
    second: list[float], ends: tuple[bool, bool, bool, bool] = (E, E, E, E)
) -> ParallelRelations:
    """The relation of (0, 0) -> (4, 0) and `second`."""
    L = LineSegments.of(np.array([[0.0, 0.0, 4.0, 0.0], second]), [ends[:2], ends[2:]])
    return ParallelRelations.of(L, False, WINDOWS)


def test_figure_4_5_the_three_overlap_classes() -> None:
    over = parallel([3, 1.5, 1, 1.5])
    assert (over.o[0], over.exact[0]) == (OVERLAP, True)
    assert (over.d_h[0], over.d_v[0]) == pytest.approx((2.0, 1.5))
    apart = parallel([8, 1.5, 6, 1.5])
    assert (apart.o[0], apart.exact[0]) == (NO_OVERLAP, True)
    assert (apart.d_h[0], apart.d_v[0]) == pytest.approx((2.0, 1.5))
    for ends in ((E, I, E, E), (E, E, E, I), (I, I, I, I)):  # one that faces the gap is interior
        assert parallel([8, 1.5, 6, 1.5], ends).o[0] == MAY_OVERLAP
    assert parallel([8, 1.5, 6, 1.5], (I, E, I, E)).o[0] == NO_OVERLAP  # the far ends do not matter


def test_figure_4_7_a_corridor_is_no_pair_of_steps() -> None:
    """Equal distance and overlap, but beta is 180 degrees for walls that face each other."""
    corridor, steps = parallel([3, 1.5, 1, 1.5]), parallel([1, 1.5, 3, 1.5])
    assert np.degrees(corridor.beta[0]) == pytest.approx(180.0)
    assert np.degrees(steps.beta[0]) == pytest.approx(0.0)
    assert steps.d_v == pytest.approx(corridor.d_v)
    assert matches(corridor, corridor)
    assert not matches(corridor, steps)


def matches(c: ParallelRelations, x: ParallelRelations) -> bool:
    return len(c.compatible(x, ANY, WINDOWS)[0]) > 0


def test_exact_distances_must_be_equal() -> None:
    wide, narrow = parallel([3, 1.5, 1, 1.5]), parallel([3, 1.3, 1, 1.3])
    assert not matches(wide, narrow)  # d^v
    assert not matches(wide, parallel([2.5, 1.5, 1, 1.5]))  # overlaps of 2 and 1.5 m
    assert not matches(parallel([8, 1.5, 6, 1.5]), parallel([8, 1.5, 7, 1.5]))  # gaps
    assert not matches(wide, parallel([8, 1.5, 6, 1.5]))  # overlap and no overlap


def test_what_interior_points_bound_is_a_bound() -> None:
    """A seen overlap is the least, a seen gap the greatest that there may be (departure)."""
    whole = parallel([3, 1.5, 1, 1.5])  # overlaps 2 m
    less_seen = parallel([2, 1.5, 1, 1.5], (E, E, I, E))  # at least 1 m
    more_seen = parallel([3.5, 1.5, 1, 1.5], (E, E, I, E))  # at least 2.5 m
    assert (less_seen.o[0], less_seen.exact[0]) == (OVERLAP, False)
    for a, b in ((whole, less_seen), (less_seen, whole)):
        assert matches(a, b)
    for a, b in ((whole, more_seen), (more_seen, whole)):
        assert not matches(a, b)
    gap = parallel([8, 1.5, 6, 1.5])
    may = parallel([8, 1.5, 7, 1.5], (E, E, E, I))
    assert matches(gap, may)
    assert matches(whole, may)
    assert not matches(gap, parallel([8, 1.5, 5, 1.5], (E, E, E, I)))


def test_almost_parallel_and_not_parallel() -> None:
    tilted = parallel([3, 1.5 + 2.0 * math.tan(math.radians(2.0)), 1, 1.5])
    assert tilted.d_v[0] == pytest.approx(1.535, abs=0.01)  # in the middle of the overlap
    assert len(parallel([3, 1.5, 1, 1.8])) == 0
    assert len(parallel([3, 1.5, 3, 3.0])) == 0


@pytest.mark.parametrize("seed", range(5))
def test_parallel_relations_know_neither_frame_nor_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ends = [(bool(a), bool(b)) for a, b in rng.random((6, 2)) < 0.5]
    x, y = rng.uniform(-4.0, 4.0, (2, 6))
    length = rng.uniform(-3.0, 3.0, 6)
    L = LineSegments.of(np.column_stack([x, y, x + length, y]), ends)
    a = ParallelRelations.of(L, True, WINDOWS)
    b = ParallelRelations.of(L.moved(Pose(3.0, 1.0, 0.9)), True, WINDOWS)
    for name in ("o", "d_h", "exact", "d_v"):
        values = getattr(a, name)
        assert getattr(b, name) == pytest.approx(values, abs=1e-9)
        assert values[: len(a) // 2] == pytest.approx(values[len(a) // 2 :])  # (m, k) as (k, m)


# Edge distance (§4.5)


def two_corners(d: float = 3.0) -> Edges:
    """Corners at (0, 0) and (d, 0): lines 0 and 1 meet in the one, 2 and 3 in the other."""
    quarter = math.pi / 2
    return Edges.of(
        ANGLE,
        np.array([[0.0, 0.0], [d, 0.0]]),
        [[0, 1], [2, 3]],
        np.array([[-quarter, 0.0], [0.0, quarter]]),
    )


def test_figure_4_8_the_four_angles() -> None:
    relation = EdgeRelations.of(two_corners(), False, WINDOWS)
    assert relation.d_e == pytest.approx([3.0])
    assert np.degrees(relation.theta[0]) == pytest.approx([90.0, 0.0, 0.0, 270.0])
    assert relation.lines.tolist() == [[0, 1, 2, 3]]


def edge_matches(c: Edges, x: Edges) -> bool:
    a, b = EdgeRelations.of(c, False, WINDOWS), EdgeRelations.of(x, False, WINDOWS)
    return len(a.compatible(b, ANY, WINDOWS)[0]) > 0


def test_distance_and_all_angles_must_agree() -> None:
    c = two_corners()
    assert edge_matches(c, c.moved(Pose(1.0, 2.0, 2.5)))
    assert not edge_matches(c, two_corners(3.2))
    for edge, side in ((0, 0), (0, 1), (1, 0), (1, 1)):
        directions = c.directions.copy()
        directions[edge, side] += math.radians(10.0)
        assert not edge_matches(c, replace(c, directions=directions))


def test_a_jump_edge_bounds_its_missing_angle() -> None:
    c = two_corners()
    for middle, expected in ((90.0, True), (130.0, True), (140.0, False), (-90.0, False)):
        x = Edges(
            np.array([ANGLE, JUMP]),
            c.point,
            np.array([[0, 1], [2, NONE]]),
            np.array([c.directions[0], [0.0, math.radians(middle)]]),
            np.array([[0.0, 0.0], [0.0, math.radians(35.0)]]),
        )
        assert edge_matches(c, x) is expected
        assert edge_matches(x, c) is expected


def test_inconsistent_edges_have_no_equal_distance() -> None:
    a = EdgeRelations.of(two_corners(), False, WINDOWS)
    tables = ConsistencyTables(np.ones((4, 4), bool), np.array([[True, True], [True, False]]))
    assert len(a.compatible(a, tables, WINDOWS)[0]) == 0


def test_edges_at_one_place_have_no_distance_line() -> None:
    assert len(EdgeRelations.of(two_corners(0.1), False, WINDOWS)) == 0


# All relations


def scan_primitives(seed: int) -> Primitives:
    rng = np.random.default_rng(seed)
    scan = sick_lms200().scan(world_named("rooms", seed), Pose(2.5, 2.0, 0.4 * seed), rng)
    return extract_primitives(scan)


@pytest.mark.parametrize("seed", range(4))
def test_every_relation_finds_itself_in_any_frame(seed: int) -> None:
    p = scan_primitives(seed)
    moved = p.moved(Pose(-3.0, 5.0, 2.2))
    tables = consistency_tables(moved, p, WINDOWS)
    G_c, G_x = extract_relations(p, WINDOWS), extract_relations(moved, WINDOWS)
    assert len(G_c) > 20
    for c, x in zip(G_c.kinds, G_x.kinds, strict=True):
        i, j = c.compatible(x, tables, WINDOWS)
        assert set(i[i == j].tolist()) == set(range(len(c)))


def test_a_scan_without_lines_has_no_relations() -> None:
    nothing = Primitives(LineSegments.of([]), Edges.of(ANGLE, [], [], []))
    G: RelationSet = extract_relations(nothing, WINDOWS, both_orders=True)
    assert len(G) == 0
    tables = consistency_tables(nothing, nothing, WINDOWS)
    assert all(len(k.compatible(k, tables, WINDOWS)[0]) == 0 for k in G.kinds)


@pytest.mark.parametrize("period", [None, math.tau])
def test_near_pairs_are_all_near_pairs(period: float | None) -> None:
    rng = np.random.default_rng(1)
    a, b = rng.uniform(-4.0, 4.0, 40), rng.uniform(-4.0, 4.0, 60)
    i, j = near_pairs(a, b, 0.3, period)
    apart = np.abs(a[:, None] - b)
    if period is not None:
        apart = np.abs(wrap_array(a[:, None] - b))
    expected = {(k, m) for k, m in np.argwhere(apart <= 0.3).tolist()}
    assert set(zip(i.tolist(), j.tolist(), strict=True)) == expected
    assert len(i) == int((apart <= 0.3).sum())
