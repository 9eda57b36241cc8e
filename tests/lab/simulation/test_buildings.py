"""The built-in worlds: known by name, the same for a seed, and passable throughout."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_lab.simulation import (
    FreeSpace,
    Planner,
    long_corridor,
    office_floor,
    rooms,
    world_named,
    world_names,
)
from lineloom_lab.simulation.blueprint import Blueprint
from lineloom_lab.simulation.furniture import Room


@pytest.mark.parametrize("name", world_names())
def test_a_name_and_a_seed_make_one_world(name: str) -> None:
    first, again = world_named(name, 4), world_named(name, 4)
    assert first.name == name
    np.testing.assert_array_equal(first.walls, again.walls)
    assert FreeSpace.of(first).area > 20.0


@pytest.mark.parametrize("name", ["office", "rooms", "corridors"])
def test_another_seed_makes_another_world(name: str) -> None:
    assert not np.array_equal(world_named(name, 1).walls, world_named(name, 2).walls)


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"'ofice'.*corridors.*office.*rooms"):
        world_named("ofice")


@pytest.mark.parametrize("seed", range(8))
def test_every_room_of_an_office_can_be_reached(seed: int) -> None:
    world = office_floor(seed)
    space = FreeSpace.of(world, radius=0.3)
    assert world.bounds[2] - world.bounds[0] == pytest.approx(40.15, abs=0.01)
    assert len(world.walls) > 600
    # Whoever stands at random where there is half a metre of room stands on the reachable floor,
    # or shut in by furniture: at most in 2 of 100 draws.
    rng, stranded, drawn = np.random.default_rng(seed), 0, 0
    while drawn < 600:
        x, y = rng.uniform(world.bounds[:2], world.bounds[2:])
        if not world.is_free(x, y, 0.5):
            continue
        drawn += 1
        row, column = int((y - space.origin[1]) / 0.1), int((x - space.origin[0]) / 0.1)
        stranded += not space.reachable[row, column]
    assert stranded <= 12


@pytest.mark.parametrize("seed", range(5))
def test_all_four_rooms_are_connected(seed: int) -> None:
    world = rooms(seed)
    x0, y0, x1, y1 = world.bounds
    planner = Planner(FreeSpace.of(world, radius=0.3))
    near_corners = [
        planner.space.centre(*planner.space.nearest_cell(x, y)) for x in (x0, x1) for y in (y0, y1)
    ]
    assert np.isfinite(planner.distances(near_corners)).all()
    for (x, y), corner in zip(near_corners, [(x0, y0), (x0, y1), (x1, y0), (x1, y1)], strict=True):
        assert np.hypot(x - corner[0], y - corner[1]) < 3.0


def test_a_long_corridor_looks_alike_every_spacing() -> None:
    world = long_corridor(45.0, 2.2, 3.0)
    beams = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False) + 1e-4
    here, there = (world.cast(x, 1.0, beams, 8.0) for x in (20.1, 23.1))
    np.testing.assert_allclose(here, there, atol=1e-6)
    end = world.cast(3.1, 1.0, beams, 8.0)
    assert not np.allclose(np.minimum(end, 9.0), np.minimum(here, 9.0))


def test_walls_keep_their_openings() -> None:
    plan = Blueprint("wall")
    plan.wall((0.0, 0.0), (6.0, 0.0), [(1.0, 2.0), (4.0, 5.0)], thickness=0.2)
    world = plan.world()
    down = [world.cast(x, 1.0, [-np.pi / 2])[0] for x in (0.5, 1.5, 3.0, 4.5, 5.5)]
    np.testing.assert_allclose(down, [0.9, np.inf, 0.9, np.inf, 0.9])
    with pytest.raises(ValueError, match="do not fit"):
        plan.wall((0.0, 0.0), (2.0, 0.0), [(1.5, 2.5)])


def test_furniture_never_blocks_a_way() -> None:
    room = Room((0.0, 0.0, 5.0, 4.0), keep_free=[(2.0, -1.0, 3.0, 1.2)])
    assert room.take((0.0, 0.0, 1.0, 0.5))
    assert not room.admits((2.5, 0.0, 3.5, 0.5)), "in front of the door"
    assert not room.admits((0.0, 1.0, 1.0, 1.5)), "too close to the first piece"
    assert not room.admits((3.9, 0.0, 4.7, 0.5)), "a gap no robot passes"
    assert room.admits((4.0, 0.0, 5.0, 0.5))
