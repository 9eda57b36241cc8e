"""Several robots with unknown start poses: merged where they met, never where they did not."""

from __future__ import annotations

from itertools import chain
from operator import attrgetter

import pytest
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_lab.simulation import (
    Fleet,
    SimulatedRobot,
    SimulatedScan,
    World,
    corridors,
    long_corridor,
    office_floor,
    rooms,
    scanner_360,
    sick_lms200,
)

from tests.core.mapping.drives import component_error, mapped

SEEDS = pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in (1, 2))]
)


def worst_merge(view: SiteView, scans: list[SimulatedScan]) -> float:
    """Greatest error [m] of a pose in any component that holds more than one robot; 0 if none."""
    shared = [c.id for c in view.components if len(c.robots) > 1]
    return max((component_error(view, scans, c).max for c in shared), default=0.0)


@pytest.fixture(scope="module", params=[0, pytest.param(3, marks=pytest.mark.long)])
def office(request: pytest.FixtureRequest) -> tuple[SiteView, list[SimulatedScan]]:
    """Three robots on an office floor for a minute and a half."""
    fleet = Fleet.office(seed=request.param, robots=3, duration_s=90.0, lidar=sick_lms200())
    scans = list(fleet.scans())
    return mapped(scans).view(), scans


def test_three_robots_in_an_office_become_one_map(
    office: tuple[SiteView, list[SimulatedScan]],
) -> None:
    view, scans = office
    assert [c.robots for c in view.components] == [("robot-1", "robot-2", "robot-3")]
    error = component_error(view, scans, view.components[0].id)
    assert error.rmse < 0.05
    assert error.max < 0.2
    assert error.rotation_rmse < 0.02


def test_absorbed_components_point_to_the_survivor(
    office: tuple[SiteView, list[SimulatedScan]],
) -> None:
    view, _ = office
    alive = {c.id for c in view.components}
    assert len(view.merged_into) == 2
    for absorbed in view.merged_into:
        assert absorbed not in alive
        at = absorbed
        while at not in alive:
            at = view.merged_into[at]  # a chain that ends, in a component that lives
        assert at == view.keyframes[0].component


def test_full_turn_scanners_merge_as_well() -> None:
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=40.0, lidar=scanner_360())
    scans = list(fleet.scans())
    view = mapped(scans).view()
    assert len(view.components) == 1
    assert component_error(view, scans).max < 0.05


def robot_in(world: World, name: str, seed: int, duration_s: float = 60.0) -> SimulatedRobot:
    return SimulatedRobot.wandering(
        name, world, lidar=sick_lms200(), seed=seed, duration_s=duration_s
    )


def together(*robots: SimulatedRobot) -> list[SimulatedScan]:
    return sorted(chain(*(r.scans() for r in robots)), key=attrgetter("time_s"))


@pytest.mark.parametrize(
    "worlds",
    [
        pytest.param((office_floor(0), office_floor(5)), id="two offices"),
        pytest.param((rooms(0), rooms(1)), id="two flats", marks=pytest.mark.long),
        pytest.param((corridors(0), corridors(1)), id="two corridors"),
        pytest.param(
            (office_floor(0), corridors(3)), id="office and corridors", marks=pytest.mark.long
        ),
    ],
)
def test_robots_in_different_buildings_are_never_merged(worlds: tuple[World, World]) -> None:
    scans = together(robot_in(worlds[0], "a", 1), robot_in(worlds[1], "b", 2))
    view = mapped(scans).view()
    assert all(len(c.robots) == 1 for c in view.components)
    assert view.merged_into == {}


@SEEDS
def test_a_corridor_that_repeats_itself_never_merges_wrongly(seed: int) -> None:
    world = long_corridor()
    left = SimulatedRobot.through(
        "a",
        world,
        [(3.0, 1.1), (15.0, 1.1), (5.0, 1.1), (14.0, 1.1)],
        lidar=sick_lms200(),
        seed=seed,
    )
    right = SimulatedRobot.through(
        "b",
        world,
        [(42.0, 1.1), (29.0, 1.1), (40.0, 1.1), (30.0, 1.1)],
        lidar=sick_lms200(),
        seed=seed + 50,
    )
    scans = together(left, right)
    view = mapped(scans).view()
    assert worst_merge(view, scans) < 1.0


@SEEDS
def test_robots_that_share_a_repeating_corridor_merge_rightly_or_not_at_all(seed: int) -> None:
    fleet = Fleet.touring(
        long_corridor(), robots=2, seed=seed, duration_s=90.0, lidar=sick_lms200()
    )
    scans = list(fleet.scans())
    assert worst_merge(mapped(scans).view(), scans) < 1.0


def test_a_right_merge_of_turned_round_robots_is_not_a_mirror_image() -> None:
    # Two robots pass through the same rooms in opposite directions.
    world = rooms(2)
    first = robot_in(world, "a", 3, 60.0)
    back = SimulatedRobot.through(
        "b",
        world,
        first.drive.positions(list(range(60, -1, -3))),
        lidar=sick_lms200(),
        seed=9,
    )
    scans = together(first, back)
    view = mapped(scans).view()
    assert worst_merge(view, scans) < 0.2
