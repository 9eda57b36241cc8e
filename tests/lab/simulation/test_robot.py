"""Simulated robots: their scans, clocks, mounts, odometry and faults."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.scan import Mount
from lineloom_lab.simulation import (
    DriftingOdometry,
    Drive,
    Followers,
    FreeSpace,
    Planner,
    ScanLoss,
    SimulatedRobot,
    Walkers,
    World,
    glazed,
    office_floor,
    rectangle,
    rooms,
    sick_lms200,
)


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner(FreeSpace.of(rooms(2)))


@pytest.fixture(scope="module")
def robot(planner: Planner) -> SimulatedRobot:
    return SimulatedRobot.wandering(
        "one", planner.space.world, lidar=sick_lms200(), seed=5, duration_s=40.0, planner=planner
    )


def test_scans_come_at_the_lidar_s_rate_on_the_robot_s_clock(robot: SimulatedRobot) -> None:
    late = replace(robot, clock_offset_s=1.7e9, phase_s=0.05)
    scans = list(late.scans())
    assert len(scans) == 200
    assert [s.scan.seq for s in scans] == list(range(200))
    assert scans[10].time_s == pytest.approx(2.05)
    assert scans[10].scan.stamp == pytest.approx(1.7e9 + 2.05)
    assert scans[0].scan.odometry is None


def test_the_true_pose_explains_the_scan(robot: SimulatedRobot) -> None:
    for simulated in islice(robot.scans(), 0, None, 20):
        exact = robot.lidar.exact_ranges(robot.world, simulated.true_pose)
        assert np.median(np.abs(simulated.scan.ranges - exact)) < 0.02


def test_the_same_seed_yields_the_same_scans_twice(robot: SimulatedRobot) -> None:
    first, again = list(robot.scans()), list(robot.scans())
    other = list(replace(robot, seed=6).scans())
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)
    assert not np.array_equal(first[3].scan.ranges, other[3].scan.ranges)
    assert first[3].true_pose == other[3].true_pose


def test_a_mount_moves_the_laser(robot: SimulatedRobot) -> None:
    T_base_laser = Pose(0.15, 0.0, math.pi)
    mounted = replace(robot, mount=Mount(T_base_laser, inverted=True))
    simulated = list(islice(mounted.scans(), 30))[-1]
    base = robot.drive.pose_at(simulated.time_s)
    assert simulated.true_pose == base @ T_base_laser
    exact = robot.lidar.exact_ranges(robot.world, simulated.true_pose)
    righted = simulated.scan.counter_clockwise(inverted=True)
    assert np.median(np.abs(righted.ranges - exact)) < 0.02


def test_odometry_drifts_but_not_without_bounds(robot: SimulatedRobot) -> None:
    drifting = list(replace(robot, odometry=DriftingOdometry()).scans())
    plain = list(robot.scans())
    np.testing.assert_array_equal(drifting[-1].scan.ranges, plain[-1].scan.ranges)
    first, last = drifting[0], drifting[-1]
    assert first.scan.odometry == Pose.identity()
    assert last.scan.odometry is not None
    truth = first.true_pose.between(last.true_pose)
    error = truth.between(last.scan.odometry)
    assert 0.02 < math.hypot(error.x, error.y) < 3.0
    assert 1e-3 < abs(error.theta) < 0.6


def test_the_drift_does_not_depend_on_how_often_it_is_measured() -> None:
    noisy, spreads = DriftingOdometry(length_scale=1.0, turn_scale=1.0, pull=0.0), []
    for steps in (20, 320):
        poses = [Pose(10.0 * i / steps, 0.0, 0.0) for i in range(steps + 1)]
        ends = [list(noisy.measure(poses, np.random.default_rng(i)))[-1] for i in range(300)]
        spreads.append((np.std([p.x for p in ends]), np.std([p.theta for p in ends])))
    np.testing.assert_allclose(spreads[0], spreads[1], rtol=0.2)
    assert spreads[0][1] == pytest.approx(0.01 * math.sqrt(10.0), rel=0.15)


def test_a_perfect_odometer_tells_the_truth() -> None:
    perfect = DriftingOdometry(0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0)
    poses = [Pose(1.0, 2.0, 0.5), Pose(2.0, 2.0, 3.0), Pose(2.0, -1.0, -3.0)]
    for pose, believed in zip(poses, perfect.measure(poses, np.random.default_rng(0)), strict=True):
        truth = poses[0].between(pose)
        assert believed.distance(truth) < 1e-12
        assert abs(angle_difference(believed.theta, truth.theta)) < 1e-12


def test_lost_scans_leave_gaps_in_seq(robot: SimulatedRobot) -> None:
    lossy = list(replace(robot, loss=ScanLoss(0.3, burst=4.0)).scans())
    seqs = [s.scan.seq for s in lossy]
    assert 60 < len(lossy) < 200
    assert seqs == sorted(set(seqs))
    whole = {s.scan.seq: s for s in robot.scans()}
    np.testing.assert_array_equal(lossy[-1].scan.ranges, whole[seqs[-1]].scan.ranges)


def test_scan_loss_has_its_share_and_burst() -> None:
    drawn = list(islice(ScanLoss(0.2, burst=5.0).lost(np.random.default_rng(0)), 50_000))
    bursts = np.count_nonzero(np.diff([0, *map(int, drawn)]) == 1)
    assert np.mean(drawn) == pytest.approx(0.2, abs=0.02)
    assert sum(drawn) / bursts == pytest.approx(5.0, rel=0.08)
    for share, burst in ((1.0, 2.0), (0.2, 0.5), (0.9, 1.0)):
        with pytest.raises(ValueError, match=r"share|burst"):
            ScanLoss(share, burst)


def test_followers_are_where_the_robot_was() -> None:
    drive = Drive.along([(1.0, 1.0), (7.0, 1.0)], rectangle(), radius=0.25, speed=0.5)
    crowd = Followers(drive, 2, behind_s=2.0)
    np.testing.assert_allclose(crowd.disks(6.0), [[3.0, 1.0, 0.2], [2.0, 1.0, 0.2]])
    np.testing.assert_allclose(crowd.disks(0.0)[:, :2], [[1.0, 1.0], [1.0, 1.0]])


def test_people_walk_in_the_way(planner: Planner, robot: SimulatedRobot) -> None:
    people = Walkers.strolling(planner, 4, np.random.default_rng(0))
    for time_s in np.arange(0.0, 400.0, 1.7):
        disks = people.disks(float(time_s))
        assert disks.shape == (4, 3)
        assert all(planner.space.world.is_free(x, y, 0.24) for x, y, _ in disks)
    crowded, empty = list(replace(robot, blockers=(people,)).scans()), list(robot.scans())
    nearer = [
        np.mean(a.scan.ranges < b.scan.ranges - 0.2) for a, b in zip(crowded, empty, strict=True)
    ]
    assert 0.005 < np.mean(nearer) < 0.5
    assert all(
        np.mean(a.scan.ranges > b.scan.ranges + 0.2) < 0.02
        for a, b in zip(crowded, empty, strict=True)
    )


def test_glazing_opens_both_faces_of_a_wall() -> None:
    world = office_floor(0)
    glassy = glazed(world, 0.3, np.random.default_rng(1))
    assert len(glassy.walls) + len(glassy.glass) == len(world.walls)
    assert 0.05 < len(glassy.glass) / len(world.walls) < 0.6
    assert FreeSpace.of(glassy).area == pytest.approx(FreeSpace.of(world).area, rel=0.02)
    wall = World(np.array([[0, 0, 6, 0], [0, 0.15, 6, 0.15], [0, 3, 6, 3]]))
    seen = glazed(wall, 0.5, np.random.default_rng(2)).cast(3.0, -1.0, [math.pi / 2])[0]
    assert seen in (pytest.approx(1.0), pytest.approx(4.0), math.inf)


def test_given_stops_are_visited() -> None:
    stops = [(1.0, 1.0), (7.0, 4.0), (1.0, 4.0)]
    robot = SimulatedRobot.through("r", rectangle(), stops, lidar=sick_lms200())
    way = np.array([(s.true_pose.x, s.true_pose.y) for s in robot.scans()])
    for stop in stops:
        assert np.hypot(*(way - stop).T).min() < 0.5
