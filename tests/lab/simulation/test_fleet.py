"""Fleets: interleaved, repeatable, and with enough in common to be merged."""

from __future__ import annotations

from itertools import islice, pairwise

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import DriftingOdometry, Fleet, rooms, sick_lms200


@pytest.fixture(scope="module")
def fleet() -> Fleet:
    return Fleet.office(seed=2, robots=3, duration_s=180.0)


def test_scans_are_interleaved_in_time(fleet: Fleet) -> None:
    scans = list(islice(fleet.scans(), 600))
    assert all(a.time_s <= b.time_s for a, b in pairwise(scans))
    assert {s.robot for s in scans} == {"robot-1", "robot-2", "robot-3"}
    for robot in fleet.robots:
        own = [s.scan for s in scans if s.robot == robot.name]
        assert [s.seq for s in own] == list(range(len(own)))
        assert all(a.stamp < b.stamp for a, b in pairwise(own))


def test_clocks_and_starts_are_apart(fleet: Fleet) -> None:
    offsets = sorted(r.clock_offset_s for r in fleet.robots)
    assert all(b - a > 1.0 for a, b in pairwise(offsets))
    starts = [r.drive.start for r in fleet.robots]
    assert min(a.distance(b) for i, a in enumerate(starts) for b in starts[:i]) > 4.0


def test_a_seed_makes_a_fleet() -> None:
    first, again, other = (
        Fleet.touring(rooms(3), robots=2, seed=seed, duration_s=10.0, people=1)
        for seed in (7, 7, 8)
    )
    for a, b in zip(first.scans(), again.scans(), strict=True):
        assert (a.robot, a.true_pose, a.scan.stamp) == (b.robot, b.true_pose, b.scan.stamp)
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)
    assert next(other.scans()).true_pose != next(first.scans()).true_pose


def test_every_robot_shares_15_metres_with_every_other(fleet: Fleet) -> None:
    overlap = fleet.overlap_m(within_m=1.0)
    assert overlap.min() >= 15.0
    assert np.diag(overlap).min() > 40.0


def test_no_robot_touches_a_wall_or_stops_early(fleet: Fleet) -> None:
    for robot in fleet.robots:
        assert robot.drive.duration_s >= 180.0
        way = robot.drive.positions(np.arange(0.0, 180.0, 0.1))
        assert min(fleet.world.clearance(x, y, cap=1.0) for x, y in way) >= 0.25 - 1e-9


def test_starts_may_be_given_and_everything_switched_on() -> None:
    starts = [Pose(1.5, 1.5, 0.3), Pose(11.0, 8.0, -2.0)]
    fleet = Fleet.touring(
        rooms(0),
        robots=2,
        seed=4,
        duration_s=20.0,
        lidar=sick_lms200(),
        starts=starts,
        odometry=DriftingOdometry(),
        people=2,
        see_each_other=True,
    )
    for robot, start in zip(fleet.robots, starts, strict=True):
        assert robot.drive.start.distance(start) < 1.0
        assert robot.drive.start.theta == pytest.approx(start.theta)
    scans = list(fleet.scans())
    assert len(scans) == 200
    assert all(s.scan.odometry is not None for s in scans)
    with pytest.raises(ValueError, match="as many starts"):
        Fleet.touring(rooms(0), robots=3, starts=starts)


def test_one_robot_is_a_fleet_too() -> None:
    fleet = Fleet.touring(rooms(1), robots=1, duration_s=10.0, lidar=sick_lms200())
    assert len(list(fleet.scans())) == 50
    with pytest.raises(ValueError, match="at least 1"):
        Fleet.touring(rooms(1), robots=0)
