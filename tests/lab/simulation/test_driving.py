"""Paths and drives: free of collisions and within the robot's limits."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from lineloom_core.geometry import Pose, angle_difference
from lineloom_lab.simulation import Drive, FreeSpace, Leg, Planner, office_floor, rectangle


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner(FreeSpace.of(office_floor(3), radius=0.25))


def random_drive(planner: Planner, seed: int, stops: int = 6) -> Drive:
    rng = np.random.default_rng(seed)
    path = planner.route([planner.space.random_point(rng) for _ in range(stops)])
    return Drive.along(path, planner.space.world, radius=0.25, heading=1.0)


@pytest.mark.parametrize("seed", range(4))
def test_the_robot_never_touches_a_wall(planner: Planner, seed: int) -> None:
    drive, world = random_drive(planner, seed), planner.space.world
    way = drive.positions(np.arange(0.0, drive.duration_s + 0.05, 0.05))
    assert drive.length_m > 20.0
    assert min(world.clearance(x, y, cap=1.0) for x, y in way) >= 0.25 - 1e-9
    steps = pairwise(way)
    assert all(world.is_move_free(p, q, 0.25 - 1e-3) for p, q in steps)


def test_speed_and_turning_stay_within_their_limits(planner: Planner) -> None:
    drive, step = random_drive(planner, 9), 0.01
    poses = [drive.pose_at(t) for t in np.arange(0.0, drive.duration_s, step)]
    for a, b in pairwise(poses):
        assert a.distance(b) <= 0.5 * step + 1e-9
        assert abs(angle_difference(b.theta, a.theta)) <= 1.0 * step + 1e-9


def test_a_robot_only_moves_the_way_it_looks(planner: Planner) -> None:
    drive = random_drive(planner, 10)
    for leg in drive.legs:
        step = leg.start.between(leg.pose_at(0.01 * leg.duration_s))
        assert abs(step.y) <= 0.02 * abs(step.x) + 1e-9
        assert step.x >= -1e-12


def test_legs_join(planner: Planner) -> None:
    drive = random_drive(planner, 11)
    assert drive.pose_at(-1.0) == drive.start
    for before, after in pairwise(drive.legs):
        assert before.end.distance(after.start) < 1e-9
    assert drive.pose_at(1e6).distance(drive.legs[-1].end) < 1e-12


def test_an_arc_ends_where_geometry_says() -> None:
    end = Leg(Pose(1.0, 2.0, 0.0), 0.5 * math.pi, math.pi / 2, 3.0).end
    np.testing.assert_allclose(end.to_array(), [2.0, 3.0, math.pi / 2], atol=1e-12)


def test_a_path_goes_from_start_to_goal_without_needless_corners() -> None:
    world = rectangle(8.0, 5.0).with_walls([[4.0, 0.0, 4.0, 3.5]])
    path = Planner(FreeSpace.of(world, radius=0.25)).path((1.0, 1.0), (7.0, 1.0))
    np.testing.assert_allclose(path[[0, -1]], [[1.0, 1.0], [7.0, 1.0]], atol=0.08)
    assert len(path) <= 7
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    assert 8.0 < length < 9.5


def test_a_stop_out_of_reach_is_named(planner: Planner) -> None:
    with pytest.raises(ValueError, match=r"\(90.00, 5.00\) cannot be reached in 'office'"):
        planner.path((90.0, 5.0), (20.0, 10.0))


def test_a_robot_without_a_way_stands_still() -> None:
    drive = Drive.along([(2.0, 2.0)], rectangle(), radius=0.25, heading=0.7)
    assert drive.duration_s == 0.0
    assert drive.pose_at(5.0) == Pose(2.0, 2.0, 0.7)
    with pytest.raises(ValueError, match="at least one point"):
        Drive.along([], rectangle(), radius=0.25)
    with pytest.raises(ValueError, match="positive"):
        Drive.along([(2.0, 2.0)], rectangle(), radius=0.25, speed=0.0)
