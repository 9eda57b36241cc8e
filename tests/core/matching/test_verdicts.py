"""Scenes where the honest answer is known: sure, weak, ambiguous or nothing."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching import LineMatcher, MatchResult
from lineloom_core.scan import Scan
from lineloom_lab.evaluation import pose_error
from lineloom_lab.simulation import (
    FreeSpace,
    Lidar,
    World,
    rectangle,
    scanner_360,
    sick_lms200,
    world_named,
)

MATCHER = LineMatcher()
BOTH = pytest.mark.parametrize("lidar", [sick_lms200(), scanner_360()], ids=["half", "full"])


def is_right(found: Pose | None, truth: Pose) -> bool:
    if found is None:
        return False
    error = pose_error(found, truth)
    return error.translation < 0.3 and error.rotation < math.radians(5.0)


def two_scans(world: World, lidar: Lidar, a: Pose, b: Pose, seed: int = 0) -> MatchResult:
    rng = np.random.default_rng(seed)
    return MATCHER.match(lidar.scan(world, a, rng), lidar.scan(world, b, rng))


@BOTH
def test_nearby_scans_of_an_office_are_matched_and_never_wrongly(lidar: Lidar) -> None:
    """Less than 1 m and 40 degrees apart, with nothing in between."""
    world, rng = world_named("office", 0), np.random.default_rng(12)
    space, tally = FreeSpace.of(world), Counter[tuple[str, bool]]()
    while tally.total() < 120:
        a = space.random_pose(rng)
        b = a @ Pose.from_array(rng.uniform([-0.7, -0.7, -0.69], [0.7, 0.7, 0.69]))
        if world.is_move_free((a.x, a.y), (b.x, b.y), 0.2):
            result = MATCHER.match(lidar.scan(world, a, rng), lidar.scan(world, b, rng))
            tally[result.verdict, is_right(result.best, a.between(b))] += 1
    right = sum(n for (_, good), n in tally.items() if good)
    assert right >= 0.95 * 120, tally
    assert tally["match", False] == 0, tally


@BOTH
@pytest.mark.parametrize("heading", [0.5, math.pi - 0.2])
def test_a_plain_corridor_is_never_matched_in_full(lidar: Lidar, heading: float) -> None:
    """What is claimed holds up to the corridor's own symmetry, which is half a turn."""
    corridor = World(np.array([[-60.0, 0.0, 60.0, 0.0], [60.0, 2.4, -60.0, 2.4]]))
    a, b = Pose(0.0, 1.1, 0.2), Pose(0.8, 1.3, heading)
    result = two_scans(corridor, lidar, a, b)
    assert result.verdict in {"weak", "ambiguous", "none"}
    if result.weak_direction is not None and result.T_reference_current is not None:
        assert abs(math.sin(result.weak_direction + 0.2)) < 0.02
        about_middle = Pose(0.0, 2.4, math.pi)
        truths = [a.between(b), a.between(about_middle @ b)]
        errors = [pose_error(result.T_reference_current, truth) for truth in truths]
        assert min(e.across(result.weak_direction) + e.rotation for e in errors) < 0.05


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("size", [(8.0, 5.0), (6.0, 6.0)])
def test_an_empty_symmetric_room_is_ambiguous(turn: float, size: tuple[float, float]) -> None:
    """Seen all around, it looks the same from the place opposite."""
    a, b = Pose(3.0, 2.0, 0.2 + turn), Pose(4.5, 2.6, 1.3 + turn)
    result = two_scans(rectangle(*size), scanner_360(), a, b)
    assert result.verdict == "ambiguous"
    assert result.weak_direction is None
    opposite = a.between(Pose(size[0], size[1], math.pi) @ b)
    told = [result.T_reference_current, *(x.T_reference_current for x in result.alternatives)]
    assert any(is_right(T, a.between(b)) for T in told)
    assert any(is_right(T, opposite) for T in told)


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.0, 3.0])
def test_half_a_symmetric_room_is_never_matched_wrongly(turn: float) -> None:
    """A half turn looks one way, and what both look at is not symmetric."""
    room = rectangle(8.0, 5.0)
    a, b = Pose(3.0, 2.0, 0.2 + turn), Pose(4.5, 2.6, 1.3 + turn)
    result = two_scans(room, sick_lms200(), a, b)
    assert result.verdict != "match" or is_right(result.best, a.between(b))


@pytest.mark.parametrize("size", [5.0, 6.0, 8.0])
@pytest.mark.parametrize("turn", [1.1, 1.75, 2.6])
def test_half_a_square_room_is_ambiguous(turn: float, size: float) -> None:
    """Every quarter turn fits, and some wrong one shares more wall than the right one."""
    a = Pose(0.4 * size, 0.45 * size, 0.3)
    b = Pose(0.55 * size, 0.5 * size, 0.3 + turn)
    result = two_scans(rectangle(size, size), sick_lms200(), a, b)
    assert result.verdict == "ambiguous"
    assert result.alternatives


@BOTH
def test_rooms_of_other_sizes_are_not_matched(lidar: Lidar) -> None:
    small, large = rectangle(4.0, 3.0), rectangle(13.0, 9.0)
    for turn in (0.0, 1.1, 2.5):
        rng = np.random.default_rng(3)
        result = MATCHER.match(
            lidar.scan(small, Pose(1.7, 1.2, turn), rng),
            lidar.scan(large, Pose(6.0, 4.0, 0.3), rng),
        )
        assert result.verdict != "match"


@pytest.mark.parametrize(("lidar", "most"), [(sick_lms200(), 0.12), (scanner_360(), 0.05)])
def test_scans_of_different_buildings_hardly_ever_match(lidar: Lidar, most: float) -> None:
    worlds = [world_named("office", 0), world_named("rooms", 1), world_named("office", 2)]
    spaces = [FreeSpace.of(world) for world in worlds]
    rng, wrong = np.random.default_rng(1), 0
    for k in range(60):
        i, j = k % 3, (k + 1) % 3
        scans = [lidar.scan(worlds[q], spaces[q].random_pose(rng), rng) for q in (i, j)]
        wrong += MATCHER.match(*scans).verdict == "match"
    assert wrong <= most * 60


def empty_scan(value: float) -> Scan:
    return Scan.checked(
        np.full(181, value),
        angle_min=-math.pi / 2,
        angle_increment=math.pi / 180,
        range_min=0.0,
        range_max=30.0,
        stamp=0.0,
    )


@pytest.mark.parametrize("value", [math.nan, math.inf, 0.0])
def test_scans_without_lines_have_nothing_to_match_and_say_so(value: float) -> None:
    rng = np.random.default_rng(0)
    full = sick_lms200().scan(rectangle(), Pose(3.0, 2.0, 0.0), rng)
    for pair in ((empty_scan(value), full), (full, empty_scan(value))):
        result = MATCHER.match(*pair)
        assert result.verdict == "none"
        assert "line segments" in result.reason
        assert result.score == 0.0
        assert result.T_reference_current is None


def test_a_single_wall_is_too_little() -> None:
    wall = World(np.array([[-60.0, 3.0, 60.0, 3.0]]))
    here = Pose(0.0, 0.0, math.pi / 2)
    result = two_scans(wall, sick_lms200(), here, here)
    assert result.verdict == "none"
    assert "two line segments" in result.reason


def test_lidars_of_different_kinds_match_each_other() -> None:
    world, rng = world_named("office", 0), np.random.default_rng(21)
    space, right = FreeSpace.of(world), 0
    for _ in range(30):
        a = space.random_pose(rng)
        b = a @ Pose(0.0, 0.0, float(rng.uniform(-1.0, 1.0)))
        sparse, dense = sick_lms200().scan(world, a, rng), scanner_360().scan(world, b, rng)
        result = MATCHER.match(sparse, dense)
        right += is_right(result.best, a.between(b))
        assert result.verdict != "match" or is_right(result.best, a.between(b))
    assert right >= 28
