"""A step that nobody predicted is found by evidence; what cannot be known is said to be open."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.config import TrackerConfig
from lineloom_core.mapping.facts.motion import PAUSE, Expected
from lineloom_core.mapping.facts.recent import Recent
from lineloom_core.mapping.facts.step_search import Searched, search_step
from lineloom_core.matching.local_map import Cloud
from lineloom_lab.simulation import Lidar, World, rectangle, scanner_360, sick_lms200, world_named

LEAST_LEAD = TrackerConfig().least_lead
MOST_MISFIT = TrackerConfig().most_misfit
DRIVEN = [Pose(1.2, 2.0, 0.0), Pose(1.7, 2.1, 0.2), Pose(2.2, 2.2, 0.2), Pose(2.7, 2.3, 0.1)]
PLAIN = World(np.array([[-60.0, 0.0, 60.0, 0.0], [-60.0, 2.2, 60.0, 2.2]]))
SHORT = {"sick": replace(sick_lms200(), range_max=8.0),
         "360": replace(scanner_360(), range_max=8.0)}  # fmt: skip


def searched(
    world: World, lidar: Lidar, driven: list[Pose], true: Pose, *, gap: float = 2.0 * PAUSE,
    seed: int = 0,
) -> Searched:  # fmt: skip
    """Where a scan at `true` is found by one who last stood at the end of `driven`."""
    rng = np.random.default_rng(seed)
    recent = Recent(8, 8)
    for pose in driven:
        features = extract_features(lidar.scan(world, pose, rng))
        recent.add(features, Cloud.of(features), pose, depth=8)
    features = extract_features(lidar.scan(world, true, rng))
    expected = Expected((driven[-1],), 0.6, 0.5, gap, False)
    return search_step(recent, features, Cloud.of(features), driven[-1], expected)


def off(a: Pose, b: Pose) -> tuple[float, float]:
    return a.distance(b), abs(angle_difference(a.theta, b.theta))


@pytest.mark.parametrize("degrees", [-150, -90, -40, 0, 60, 120, 150])
@pytest.mark.parametrize("step", [(1.0, 0.4), (1.6, -0.6), (0.4, 1.4)])
def test_a_far_step_and_turn_are_found(step: tuple[float, float], degrees: int) -> None:
    """All around a lidar of 360 degrees."""
    true = DRIVEN[-1] @ Pose(*step, math.radians(degrees))
    found = searched(world_named("rooms", 3), scanner_360(), DRIVEN, true)
    assert off(found.best.pose, true)[0] < 0.05
    assert off(found.best.pose, true)[1] < 0.01
    assert found.freedom is None
    assert found.lead > LEAST_LEAD
    assert found.best.misfit < MOST_MISFIT


@pytest.mark.parametrize("degrees", [-60, -30, 0, 30, 60])
@pytest.mark.parametrize("step", [1.0, 1.7])
def test_half_a_turn_of_view_is_enough_for_a_third_of_it(step: float, degrees: int) -> None:
    true = DRIVEN[-1] @ Pose(step, 0.1, math.radians(degrees))
    found = searched(world_named("rooms", 3), sick_lms200(), DRIVEN, true)
    assert off(found.best.pose, true)[0] < 0.05
    assert off(found.best.pose, true)[1] < 0.01
    assert found.lead > LEAST_LEAD


@pytest.mark.parametrize("seed", range(3))
def test_among_clutter_without_walls_all_around_is_searched(seed: int) -> None:
    """Posts a hand wide: no line that the matcher could go by."""
    rng = np.random.default_rng(seed)
    at, turn = rng.uniform((-4.0, -3.0), (8.0, 7.0), (40, 2)), rng.uniform(0.0, math.pi, 40)
    at = at[np.hypot(*(at - [3.0, 2.4]).T) > 1.9]
    half = 0.04 * np.column_stack([np.cos(turn), np.sin(turn)])[: len(at)]
    world = World(np.hstack([at - half, at + half]))
    true = DRIVEN[-1] @ Pose(0.9, 0.5, math.radians(75.0))
    found = searched(world, scanner_360(), DRIVEN[2:], true, seed=seed)
    assert off(found.best.pose, true)[0] < 0.05
    assert off(found.best.pose, true)[1] < 0.01


def test_the_clock_decides_nothing() -> None:
    true = DRIVEN[-1] @ Pose(1.3, 0.2, 0.8)
    found = [
        searched(world_named("rooms", 3), scanner_360(), DRIVEN, true, gap=gap)
        for gap in (0.1, 1.0, 10.0, 1000.0)
    ]
    assert max(off(f.best.pose, true)[0] for f in found) < 0.05
    assert min(f.lead for f in found) > LEAST_LEAD


@pytest.mark.parametrize("lidar", SHORT)
@pytest.mark.parametrize("step", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("along", [0.0, 1.0])
def test_the_way_along_a_plain_corridor_is_open_and_has_no_rival(
    lidar: str, step: float, along: float
) -> None:
    """Whatever way the corridor runs."""
    turn = Pose(0.0, 0.0, along)
    world = PLAIN.moved(turn)
    driven = [turn @ Pose(0.5 * k, 1.0, 0.0) for k in range(4)]
    true = driven[-1] @ Pose(step, 0.2, 0.1)
    found = searched(world, SHORT[lidar], driven, true)
    assert found.freedom is not None
    assert found.freedom.axis is not None
    assert abs(math.sin(found.freedom.axis - along)) < 0.03
    assert found.lead > LEAST_LEAD
    across = turn.inverse() @ found.best.pose
    assert across.y == pytest.approx(1.2, abs=0.04)
    assert across.theta == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_a_room_that_is_alike_both_ways_has_a_rival(seed: int) -> None:
    """Turned by a quarter it may be either way; hardly turned, half a turn is no rival."""
    middle = Pose(4.0, 2.5, 0.0)
    driven = [Pose(3.4, 2.5, 0.0), middle]
    room, lidar = rectangle(8.0, 5.0), scanner_360()
    quarter = searched(room, lidar, driven, middle @ Pose(0, 0, math.pi / 2), seed=seed)
    assert quarter.lead < LEAST_LEAD
    assert off(quarter.best.pose, middle)[0] < 0.05
    assert abs(abs(quarter.best.pose.theta) - math.pi / 2) < 0.02
    hardly = searched(room, lidar, driven, middle @ Pose(0, 0, 0.2), seed=seed)
    assert off(hardly.best.pose, middle @ Pose(0, 0, 0.2))[0] < 0.05
    assert hardly.lead > 3.0 * LEAST_LEAD


def test_a_scan_of_another_room_does_not_fit() -> None:
    rng = np.random.default_rng(5)
    lidar, recent = scanner_360(), Recent(8, 8)
    for pose in DRIVEN:
        features = extract_features(lidar.scan(world_named("rooms", 3), pose, rng))
        recent.add(features, Cloud.of(features), pose, depth=8)
    elsewhere = extract_features(lidar.scan(rectangle(3.0, 21.0), Pose(1.0, 4.0, 0.3), rng))
    expected = Expected((DRIVEN[-1],), 0.6, 0.5, 1.0, False)
    found = search_step(recent, elsewhere, Cloud.of(elsewhere), DRIVEN[-1], expected)
    assert found.best.misfit > 5.0
    assert found.backing != "match"
