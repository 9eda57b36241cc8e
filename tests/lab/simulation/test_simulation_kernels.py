"""Each compiled loop against a slow, obvious twin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import World, _kernels
from lineloom_lab.simulation.wall_grid import WallGrid
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def random_world(seed: int, walls: int = 60) -> World:
    """Walls of all lengths and directions in 20 x 12 m, some of them upright."""
    rng = np.random.default_rng(seed)
    start = rng.uniform([-10.0, -6.0], [10.0, 6.0], size=(walls, 2))
    length, angle = rng.uniform(0.05, 8.0, walls), rng.uniform(0.0, math.tau, walls)
    angle[::3] = rng.integers(0, 4, len(angle[::3])) * (math.pi / 2)
    end = start + length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return World(np.hstack([start, end]), name=f"random-{seed}")


def slow_cast(walls: Floats, x: float, y: float, directions: Floats, limit: float) -> Floats:
    """Intersect every beam with every wall."""
    ranges = np.full(len(directions), np.inf)
    for i, direction in enumerate(directions):
        beam = np.array([math.cos(direction), math.sin(direction)])
        for x1, y1, x2, y2 in walls:
            wall = np.array([x2 - x1, y2 - y1])
            matrix = np.column_stack([beam, -wall])
            if abs(np.linalg.det(matrix)) < 1e-14:
                continue
            t, u = np.linalg.solve(matrix, np.array([x1 - x, y1 - y]))
            if t >= 0.0 and 0.0 <= u <= 1.0 and t <= limit:
                ranges[i] = min(ranges[i], t)
    return ranges


def slow_clearance(walls: Floats, p: Floats, q: Floats) -> float:
    """Try many points of the move against many points of every wall."""
    shares = np.linspace(0.0, 1.0, 201)[:, None]
    on_move = p + shares * (q - p)
    best = math.inf
    for x1, y1, x2, y2 in walls:
        on_wall = np.array([x1, y1]) + shares * np.array([x2 - x1, y2 - y1])
        gaps = on_move[:, None, :] - on_wall[None, :, :]
        best = min(best, float(np.sqrt((gaps**2).sum(axis=2)).min()))
    return best


def slow_surface(walls: Floats, x: float, y: float, hit: Floats, piece: float) -> list[int]:
    """Find the wall that a beam's end lies on, how far along it, and on which side we stand."""
    for number, (x1, y1, x2, y2) in enumerate(walls):
        wall = np.array([x2 - x1, y2 - y1])
        length, to_hit = float(np.hypot(*wall)), hit - (x1, y1)
        across = (wall[0] * to_hit[1] - wall[1] * to_hit[0]) / length
        along = float(wall @ to_hit) / length
        if abs(across) < 1e-9 and -1e-9 <= along <= length + 1e-9:
            left = wall[0] * (y - y1) - wall[1] * (x - x1) > 0.0
            return [number, math.floor(along / piece), int(left)]
    raise AssertionError("the beam ends in mid-air")


@pytest.mark.parametrize("seed", range(4))
def test_surfaces_are_those_that_the_slow_twin_finds(seed: int) -> None:
    world, rng = random_world(seed), np.random.default_rng(200 + seed)
    directions = rng.uniform(-7.0, 7.0, 150)
    x, y = (float(v) for v in rng.uniform([-10.0, -6.0], [10.0, 6.0]))
    ranges = world.cast(x, y, directions, 9.0)
    found = world.grid.surfaces(x, y, directions, 9.0, 0.25)
    assert np.isfinite(ranges).sum() > 50
    for direction, reach, surface in zip(directions, ranges, found.tolist(), strict=True):
        if np.isfinite(reach):
            hit = np.array([x + reach * math.cos(direction), y + reach * math.sin(direction)])
            assert surface == slow_surface(world.walls, x, y, hit, 0.25)
        else:
            assert surface == [-1, 0, 0]


@pytest.mark.parametrize("seed", range(4))
def test_beams_end_where_the_slow_twin_says(seed: int) -> None:
    world, rng = random_world(seed), np.random.default_rng(100 + seed)
    directions = rng.uniform(-7.0, 7.0, 150)
    x, y = rng.uniform([-10.0, -6.0], [10.0, 6.0])
    fast = world.cast(float(x), float(y), directions, 15.0)
    np.testing.assert_allclose(fast, slow_cast(world.walls, x, y, directions, 15.0), atol=1e-9)


def test_beams_from_far_outside_reach_the_walls() -> None:
    world = random_world(7)
    directions = np.linspace(-math.pi, math.pi, 240)
    fast = world.cast(-60.0, 35.0, directions)
    slow = slow_cast(world.walls, -60.0, 35.0, directions, math.inf)
    assert np.isfinite(slow).any()
    np.testing.assert_allclose(fast, slow, atol=1e-9)


def test_axis_parallel_beams_on_cell_borders_are_not_lost() -> None:
    world = World(np.array([[0.0, 0.0, 4.0, 0.0], [4.0, 0.0, 4.0, 4.0], [0.0, 4.0, 4.0, 4.0]]))
    quarter_turns = np.arange(4) * (math.pi / 2)
    for x, y in ((1.0, 1.0), (1.25, 1.75), (0.25, 0.25), (2.0, 2.0)):
        ranges = world.cast(x, y, quarter_turns)
        np.testing.assert_allclose(ranges, [4.0 - x, 4.0 - y, np.inf, y], atol=1e-9)


def test_no_beam_slips_through_a_closed_outline() -> None:
    rng = np.random.default_rng(3)
    turns = np.sort(rng.uniform(0.0, math.tau, 40))
    corners = 5.0 * np.column_stack([np.cos(turns), np.sin(turns)])
    world = World(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    at_corners = np.arctan2(corners[:, 1], corners[:, 0])
    assert np.isfinite(world.cast(0.0, 0.0, at_corners)).all()
    assert np.isfinite(world.cast(0.3, -0.2, rng.uniform(0.0, math.tau, 20_000))).all()


def test_every_wall_is_in_each_cell_that_it_passes() -> None:
    world = random_world(5)
    grid = WallGrid.of(world.walls)
    for i, (x1, y1, x2, y2) in enumerate(world.walls):
        for share in np.linspace(0.0, 1.0, 97):
            column = math.floor((x1 + share * (x2 - x1) - grid.origin[0]) / grid.cell)
            row = math.floor((y1 + share * (y2 - y1) - grid.origin[1]) / grid.cell)
            at = row * grid.columns + column
            assert i in grid.members[grid.starts[at] : grid.starts[at + 1]]


@pytest.mark.parametrize("seed", range(3))
def test_move_clearance_is_the_least_distance(seed: int) -> None:
    world, rng = random_world(seed, walls=12), np.random.default_rng(seed)
    for _ in range(25):
        p, q = rng.uniform([-10.0, -6.0], [10.0, 6.0], size=(2, 2))
        exact = _kernels.move_clearance(world.solid, p[0], p[1], q[0], q[1], 50.0)
        sampled = slow_clearance(world.walls, p, q)
        assert exact <= sampled + 1e-9
        assert sampled - exact < 0.1  # the twin's sampling


def test_clearance_map_holds_each_centre_s_distance() -> None:
    world = random_world(2, walls=20)
    columns, rows, cell = 30, 20, 0.6
    table = _kernels.clearance_map(world.solid, -9.0, -6.0, cell, columns, rows, 1.5)
    for r in range(0, rows, 3):
        for c in range(0, columns, 3):
            x, y = -9.0 + (c + 0.5) * cell, -6.0 + (r + 0.5) * cell
            assert table[r, c] == pytest.approx(world.clearance(x, y, cap=1.5), abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_moving_world_and_laser_together_changes_no_range(seed: int) -> None:
    world, rng = random_world(seed), np.random.default_rng(seed)
    pose = Pose(*(float(v) for v in rng.uniform(-3.0, 3.0, 3)))
    T_new_world = Pose(*(float(v) for v in rng.uniform(-50.0, 50.0, 3)))
    moved = T_new_world @ pose
    beams = np.linspace(-math.pi, math.pi, 721)
    before = world.cast(pose.x, pose.y, pose.theta + beams, 30.0)
    after = world.moved(T_new_world).cast(moved.x, moved.y, moved.theta + beams, 30.0)
    np.testing.assert_allclose(after, before, atol=1e-8)
