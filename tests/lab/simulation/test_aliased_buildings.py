"""Buildings of equal walls: alike where they must be, told apart by furniture, passable."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from lineloom_lab.simulation import FreeSpace, World, office_floor, rectangle
from lineloom_lab.simulation.aliased_buildings import (
    hotel_floor,
    rooms_in_a_row,
    self_similar_corridor,
    symmetric_hall,
)
from lineloom_lab.simulation.building import Building
from lineloom_lab.simulation.clutter import cluttered, cropped
from lineloom_lab.simulation.office import office_building
from numpy.typing import NDArray

BUILDERS = [rooms_in_a_row, hotel_floor, self_similar_corridor, symmetric_hall]
Builder = Callable[..., Building]


def rows(segments: NDArray[np.float64]) -> set[tuple[float, ...]]:
    return {tuple(row) for row in segments.round(9).tolist()}


@pytest.mark.parametrize("build", BUILDERS)
def test_a_seed_draws_the_same_building_again(build: Builder) -> None:
    first, again = build(3), build(3)
    np.testing.assert_array_equal(first.world.walls, again.world.walls)
    np.testing.assert_array_equal(first.telling, again.telling)
    assert rows(first.telling) != rows(build(4).telling)


@pytest.mark.parametrize("build", BUILDERS)
def test_without_what_tells_all_seeds_are_one(build: Builder) -> None:
    bare = build(3, bare=True)
    assert len(bare.telling) == 0
    assert not bare.is_telling.any()
    np.testing.assert_array_equal(bare.world.walls, build(4, bare=True).world.walls)


@pytest.mark.parametrize("build", [rooms_in_a_row, self_similar_corridor, symmetric_hall])
def test_walls_that_do_not_tell_are_the_same_for_every_seed(build: Builder) -> None:
    a, b = build(3), build(4)
    np.testing.assert_array_equal(a.world.walls[~a.is_telling], b.world.walls[~b.is_telling])


def test_rooms_in_a_row_repeat_room_by_room() -> None:
    walls = rows(rooms_in_a_row(bare=True).world.walls)
    doors = rooms_in_a_row(bare=True).doorways
    np.testing.assert_allclose(np.diff(doors[:, 0]), 4.2)
    inner = {row for row in walls if min(row[0], row[2]) > 4.5 and max(row[0], row[2]) < 25.0}
    moved = {(round(a + 4.2, 9), b, round(c + 4.2, 9), d) for a, b, c, d in inner}
    assert len(inner) > 30
    assert moved <= walls


def test_the_hall_is_the_same_turned_round() -> None:
    walls = symmetric_hall(bare=True).world.walls
    turned = np.array([20.0, 14.0, 20.0, 14.0]) - walls
    ends = {frozenset({r[:2], r[2:]}) for r in rows(walls)}
    assert {frozenset({r[:2], r[2:]}) for r in rows(turned)} == ends


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("build", BUILDERS)
def test_every_door_leads_to_the_floor_all_share(build: Builder, seed: int) -> None:
    building = build(seed)
    space = FreeSpace.of(building.world, radius=0.27)
    assert space.area > 60.0
    for x1, y1, x2, y2 in building.doorways.tolist():
        for side in (-0.9, 0.9):
            at = 0.5 * (x1 + x2), 0.5 * (y1 + y2) + side
            assert math.dist(space.centre(*space.nearest_cell(*at)), at) < 0.3


def test_floors_of_one_seed_share_walls_and_not_furniture() -> None:
    a, b = office_building(2, 0), office_building(2, 1)
    np.testing.assert_array_equal(a.world.walls[~a.is_telling], b.world.walls[~b.is_telling])
    assert not rows(a.telling) & rows(b.telling)
    np.testing.assert_array_equal(office_building(2).world.walls, office_floor(2).walls)


def test_closed_doors_stop_beams_and_come_last() -> None:
    building = rooms_in_a_row(1)
    closed = np.zeros(len(building.doorways), dtype=bool)
    closed[2] = True
    world = building.with_doors_closed(closed)
    np.testing.assert_array_equal(world.walls[:-1], building.world.walls)
    x, y = 0.5 * (building.doorways[2, 0] + building.doorways[2, 2]), -0.5
    assert world.cast(x, y, [math.pi / 2])[0] == pytest.approx(0.5)
    assert building.world.cast(x, y, [math.pi / 2])[0] > 1.5
    assert building.with_doors_closed(~closed & closed) is building.world


def test_clutter_leaves_the_floor_in_one_piece() -> None:
    bare = FreeSpace.of(rectangle(16.0, 12.0))
    filled = cluttered(bare, np.random.default_rng(0), pieces_per_m2=0.2)
    assert len(filled.walls) > len(bare.world.walls) + 20
    assert FreeSpace.of(filled).area > 0.7 * bare.area


def test_a_crop_keeps_the_walls_of_its_square() -> None:
    world = office_floor(1)
    part = cropped(world, 15.0, np.random.default_rng(2))
    assert part is not None
    assert rows(part.walls) < rows(world.walls)
    assert cropped(world, 50.0, np.random.default_rng(2)) is world
    corner = World(np.array([[0.0, 0.0, 0.1, 0.0], [99.0, 99.0, 99.0, 98.9]]))
    assert cropped(corner, 5.0, np.random.default_rng(0)) is None
