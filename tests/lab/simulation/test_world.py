"""Worlds: reading, asking for room, and refusing nonsense."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lineloom_lab.simulation import FreeSpace, World, rectangle


def test_floor_plans_may_hold_blanks_comments_and_walls_without_length(tmp_path: Path) -> None:
    file = tmp_path / "home.txt"
    file.write_text("# a plan\n\n 0, 0,  4.5, 0  # south\n1,1,1,1\n0,0,0,-3\n", encoding="utf-8")
    world = World.from_text(file)
    assert world.name == "home"
    np.testing.assert_array_equal(world.walls, [[0.0, 0.0, 4.5, 0.0], [0.0, 0.0, 0.0, -3.0]])
    assert world.bounds == (0.0, -3.0, 4.5, 0.0)


@pytest.mark.parametrize(
    "line", ["1, 2, 3", "1, 2, 3, 4, 5", "1, 2, x, 4", "1, 2, nan, 4", "1 2 3 4"]
)
def test_a_bad_line_is_named(tmp_path: Path, line: str) -> None:
    file = tmp_path / "bad.txt"
    file.write_text(f"0, 0, 1, 0\n\n{line}\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"bad\.txt:3: "):
        World.from_text(file)


def test_a_plan_without_walls_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "empty.txt"
    file.write_text("# nothing\n", encoding="utf-8")
    with pytest.raises(ValueError, match="no wall"):
        World.from_text(file)


@pytest.mark.parametrize(
    "walls", [np.empty((0, 4)), np.zeros((2, 3)), np.array([[0.0, 0.0, np.inf, 1.0]])]
)
def test_walls_must_be_finite_rows_of_four(walls: np.ndarray) -> None:
    with pytest.raises(ValueError, match="walls"):
        World(walls)


def test_a_world_keeps_its_own_read_only_walls() -> None:
    walls = np.array([[0.0, 0.0, 1.0, 0.0]])
    world = World(walls)
    walls[0, 0] = 9.0
    assert world.walls[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        world.walls[0, 0] = 1.0


def test_disks_and_moves_need_room() -> None:
    world = rectangle(8.0, 5.0).with_walls([[4.0, 0.0, 4.0, 3.0]])
    assert world.is_free(1.0, 1.0, 0.99)
    assert not world.is_free(1.0, 1.0, 1.01)
    assert world.clearance(1.0, 2.0) == pytest.approx(1.0)
    assert not world.is_move_free((1.0, 1.0), (7.0, 1.0), 0.1)
    assert world.is_move_free((1.0, 4.0), (7.0, 4.0), 0.9)
    assert not world.is_move_free((1.0, 3.5), (7.0, 3.5), 0.6)


def test_glass_stops_robots_and_lets_beams_pass() -> None:
    room = rectangle(8.0, 5.0)
    world = World(room.walls, glass=np.array([[4.0, 0.0, 4.0, 5.0]]))
    assert world.cast(1.0, 2.0, [0.0])[0] == pytest.approx(7.0)
    assert not world.is_move_free((1.0, 2.0), (7.0, 2.0), 0.1)
    half = FreeSpace.of(world, radius=0.25)
    assert half.area < 0.55 * FreeSpace.of(room, radius=0.25).area


def test_free_space_ignores_the_outside_and_sealed_furniture() -> None:
    box = [[2, 1, 5, 1], [5, 1, 5, 4], [5, 4, 2, 4], [2, 4, 2, 1]]
    world = rectangle(12.0, 8.0).with_walls(box)
    space, rng = FreeSpace.of(world, radius=0.3), np.random.default_rng(0)
    for _ in range(300):
        pose = space.random_pose(rng)
        assert world.is_free(pose.x, pose.y, 0.3)
        assert 0.0 < pose.x < 12.0
        assert 0.0 < pose.y < 8.0
        assert not (2.0 < pose.x < 5.0 and 1.0 < pose.y < 4.0)


def test_a_world_too_small_for_the_robot_is_refused() -> None:
    with pytest.raises(ValueError, match="no room indoors"):
        FreeSpace.of(rectangle(0.5, 0.5), radius=0.4)
