"""Algorithm 11: the local map (thesis §5.8)."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching.thesis import ThesisMatcher
from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.line_map import LineMap, MapLine, merge_all
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.map_update import lines_on, update_map
from lineloom_lab.simulation import World, scanner_360

ROOM = LineSegments.of(
    [[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 0, 4]], [(False, True), (True, True), (True, False)]
)
EMPTY = LineMap()


def lengths(line_map: LineMap) -> list[float]:
    return [float(length) for length in line_map.segments()[0].lengths]


def test_the_first_scan_is_the_map() -> None:
    update = update_map(EMPTY, [(0, 1)], [], ROOM)
    assert update.map_ids == (1, 2, 3)
    segments, ids = update.line_map.segments()
    assert ids == [1, 2, 3]
    assert segments.s == pytest.approx(ROOM.s)
    assert segments.e_is_edge.tolist() == [True, True, False]


def test_matching_lines_are_merged_under_their_map_id() -> None:
    first = update_map(EMPTY, [], [], ROOM)
    longer = LineSegments.of([[-1, 0, 5, 0], [6, 1, 6, 4]], [(True, False), (False, True)])
    second = update_map(first.line_map, [(0, 0), (1, 1)], first.map_ids, longer)
    assert second.map_ids == (1, 2)  # the ids follow the lines to the next scan (departure)
    assert lengths(second.line_map) == pytest.approx([7.0, 4.0, 6.0])
    segments, _ = second.line_map.segments()
    assert segments.s[0] == pytest.approx([-1.0, 0.0])
    assert bool(segments.s_is_edge[0])  # now its end has been seen


def test_a_line_without_a_match_finds_its_place_in_the_map() -> None:
    first = update_map(EMPTY, [], [], ROOM)
    more = LineSegments.of([[4.0, 0.05, 8.0, 0.05], [2.0, 2.0, 3.0, 2.0]])
    second = update_map(first.line_map, [], first.map_ids, more)
    assert second.map_ids == (1, 4)  # the last loop adds what is new (departure)
    assert lengths(second.line_map) == pytest.approx([8.0, 4.0, 6.0, 1.0], abs=0.01)


def test_a_line_that_spans_two_makes_them_one() -> None:
    """All merged lines leave the map, and their ids still lead to what they are now (departure)."""
    pieces = LineSegments.of([[0, 0, 2, 0], [4, 0, 6, 0], [0, 3, 6, 3]])
    first = update_map(EMPTY, [], [], pieces)
    second = update_map(first.line_map, [], first.map_ids, LineSegments.of([[1, 0, 5, 0]]))
    assert second.map_ids == (1,)
    assert lengths(second.line_map) == pytest.approx([6.0, 6.0])
    assert second.line_map.current_id(2) == 1
    assert second.line_map.next_id == 4  # no mapID is used twice
    third = update_map(second.line_map, [(1, 0)], first.map_ids, LineSegments.of([[4, 0, 7, 0]]))
    assert third.map_ids == (1,)
    assert lengths(third.line_map) == pytest.approx([7.0, 6.0])


def test_two_faces_of_a_wall_stay_two() -> None:
    first = update_map(EMPTY, [], [], ROOM)
    other_face = LineSegments.of([[5, -0.05, 1, -0.05]])
    second = update_map(first.line_map, [], first.map_ids, other_face)
    assert second.map_ids == (4,)
    assert len(second.line_map) == 4


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ([1.0, 0.05, 3.0, 0.05], [1]),
        ([1.0, 0.2, 3.0, 0.2], []),  # d^v
        ([7.0, 0.0, 9.0, 0.0], []),  # no overlap
        ([1.0, 0.0, 3.0, 0.4], []),  # not parallel
    ],
)
def test_lines_on_the_map(line: list[float], expected: list[int]) -> None:
    line_map = update_map(EMPTY, [], [], ROOM).line_map
    assert lines_on(line_map, LineSegments.of([line]), 0, Windows()) == expected


def test_merging_weighs_every_metre_alike() -> None:
    """A line seen ten times is not bent by a look at a piece of it."""
    L = LineSegments.of([[0.0, 0.0, 6.0, 0.0], [2.0, 0.1, 3.0, 0.1]])
    often = merge_all([MapLine.of(L, 0, 1)] * 10)
    bent = merge_all([often, MapLine.of(L, 1, 2)])
    assert bent.mass == pytest.approx(61.0)
    assert bent.centre[1] == pytest.approx(0.1 / 61.0)
    assert abs(bent.s[1]) < 0.01


def test_the_order_of_merging_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    u = np.array([math.cos(0.7), math.sin(0.7)])
    along = rng.uniform(0.0, 5.0, (6, 2))
    rows = np.hstack([np.outer(along[:, 0], u), np.outer(along[:, 1] + 5.0, u)])
    parts = [
        MapLine.of(LineSegments.of(rows + rng.normal(0, 0.01, (6, 4))), i, i) for i in range(6)
    ]
    at_once = merge_all(parts)
    one_by_one = parts[5]
    for part in parts[4::-1]:
        one_by_one = merge_all([one_by_one, part])
    assert one_by_one.centre == pytest.approx(at_once.centre)
    assert one_by_one.s == pytest.approx(at_once.s, abs=2e-2)
    assert one_by_one.scatter == pytest.approx(at_once.scatter)
    assert one_by_one.map_id == 0
    with pytest.raises(ValueError, match="no lines"):
        merge_all([])


def test_an_unknown_map_id_is_an_error() -> None:
    first = update_map(EMPTY, [], [], ROOM)
    with pytest.raises(KeyError):
        update_map(first.line_map, [(0, 0)], [99], ROOM)


def test_a_drive_builds_one_line_per_wall() -> None:
    """Chapter 5 from scans to map: an L-shaped room has six walls, however often they are seen."""
    corners = np.array([[0, 0], [8, 0], [8, 3], [3, 3], [3, 7], [0, 7]], float)
    world = World(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    rng, matcher = np.random.default_rng(0), ThesisMatcher()
    path = [Pose(1.5 + 0.5 * i, 1.2, 0.15 * i) for i in range(6)]
    scans = [matcher.prepare(scanner_360().scan(world, pose, rng)) for pose in path]
    at, update = path[0], update_map(EMPTY, [], [], scans[0].primitives.L.moved(path[0]))
    for reference, current in itertools.pairwise(scans):
        result = matcher.match_prepared(reference, current)
        assert result.verdict == "match"
        assert result.T_reference_current is not None
        at = at @ result.T_reference_current
        pairs = [(p.reference, p.current) for p in result.pairs]
        lines = current.primitives.L.moved(at)
        update = update_map(update.line_map, pairs, update.map_ids, lines)
        assert len(update.map_ids) == len(lines)
    assert at.distance(path[-1]) < 0.05
    segments, _ = update.line_map.segments()
    assert np.sort(segments.lengths[segments.lengths > 1.0]) == pytest.approx(
        [3.0, 3.0, 4.0, 5.0, 7.0, 8.0], abs=0.1
    )
