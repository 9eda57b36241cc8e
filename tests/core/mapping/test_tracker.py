"""The tracker against drives whose truth is known: drift, blocked views, clocks, kidnapping."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.config import TrackerConfig
from lineloom_core.mapping.facts.tracker import Tracked, Tracker
from lineloom_lab.simulation import (
    DriftingOdometry,
    Lidar,
    SimulatedRobot,
    SimulatedScan,
    corridors,
    long_corridor,
    rectangle,
    rooms,
    scanner_360,
    sick_lms200,
)

from tests.core.mapping.drives import covered, legs, scans_of, track, track_errors

LIDARS = pytest.mark.parametrize("lidar", [sick_lms200(), scanner_360()], ids=["sick", "360"])


def follow(scans: list[SimulatedScan], stamps: list[float] | None = None) -> list[Tracked]:
    tracker = Tracker()
    return [track(tracker, s.scan, stamps[i] if stamps else None) for i, s in enumerate(scans)]


@pytest.fixture(scope="module")
def crossing() -> list[SimulatedScan]:
    """Four metres straight across a room."""
    return scans_of(rectangle(8.0, 5.0), legs(Pose(2.0, 2.0, 0.3), (4.0, 0.0)))


@pytest.fixture(scope="module")
def turning() -> list[SimulatedScan]:
    """Half a minute among furniture, with turns on the spot at a radian a second."""
    return wandering(None, sick_lms200(), 3)


@LIDARS
@pytest.mark.parametrize("seed", [0, 1])
def test_a_straight_drive_through_a_room_drifts_by_millimetres(lidar: Lidar, seed: int) -> None:
    drive = legs(Pose(2.0, 2.0, 0.0), (10.0, 0.0))
    scans = scans_of(rectangle(14.0, 6.0), drive, seed=seed, lidar=lidar)
    found = follow(scans)
    assert [f.status for f in found] == ["first"] + ["tracked"] * (len(scans) - 1)
    errors = track_errors(scans, found)
    assert errors[:, 0].max() < 0.03
    assert errors[:, 1].max() < 0.005


@pytest.mark.parametrize("seed", [0, 1])
def test_a_corridor_with_niches_drifts_by_less_than_half_a_percent(seed: int) -> None:
    scans = scans_of(long_corridor(), legs(Pose(2.0, 1.1, 0.0), (40.0, 0.0)), seed=seed)
    errors = track_errors(scans, follow(scans))
    assert len(errors) == len(scans)
    assert errors[:, 0].max() < 0.2
    assert errors[:, 1].max() < 0.015


@LIDARS
def test_a_turn_on_the_spot_stays_on_the_spot(lidar: Lidar) -> None:
    scans = scans_of(rectangle(8.0, 5.0), legs(Pose(3.0, 2.0, 0.0), (0.0, 4.0 * math.pi)))
    found = follow(scans)
    errors = track_errors(scans, found)
    assert len(errors) == len(scans)
    assert errors[:, 0].max() < 0.03
    assert errors[:, 1].max() < 0.02
    # 20 degrees make a keyframe: two turns make at least 30 (the first included), never all scans.
    assert 30 <= sum(f.is_keyframe for f in found) < len(scans) // 2


def test_keyframes_are_as_far_apart_as_the_config_says(crossing: list[SimulatedScan]) -> None:
    config = TrackerConfig(enough_fit=0.0)  # distance and angle alone
    tracker = Tracker(config)
    found = [track(tracker, s.scan) for s in crossing]
    at = [f.pose for f in found if f.is_keyframe]
    steps = [a.distance(b) for a, b in pairwise(at) if a and b]
    assert len(steps) >= 8
    scan_step = 0.5 / 5.0  # m between scans
    assert all(
        config.keyframe_distance < s < config.keyframe_distance + scan_step + 0.03 for s in steps
    )


def test_somebody_before_the_lidar_is_skipped_and_the_track_goes_on(
    crossing: list[SimulatedScan],
) -> None:
    blocked = [
        replace(s, scan=covered(s.scan)) if 10 <= i < 13 else s for i, s in enumerate(crossing)
    ]
    found = follow(blocked)
    assert [f.status for f in found[9:14]] == ["tracked", *["skipped"] * 3, "tracked"]
    assert all(f.pose is None and not f.is_keyframe for f in found[10:13])
    assert track_errors(blocked, found)[:, 0].max() < 0.03


def test_patience_ends_in_lost_and_the_old_place_is_known_again(
    crossing: list[SimulatedScan],
) -> None:
    patience = TrackerConfig().patience
    blocked = [
        replace(s, scan=covered(s.scan)) if 10 <= i < 10 + patience + 2 else s
        for i, s in enumerate(crossing)
    ]
    status = [f.status for f in follow(blocked)]
    assert status[10 : 10 + patience] == ["skipped"] * (patience - 1) + ["lost"]
    assert "lost" not in status[10 + patience + 2 :]


def test_a_kidnapped_robot_is_lost_and_is_never_placed_wrongly(
    crossing: list[SimulatedScan],
) -> None:
    elsewhere = scans_of(rooms(1), legs(Pose(2.0, 1.5, 0.0), (2.0, 0.0)))
    tracker = Tracker()
    for s in crossing:
        track(tracker, s.scan)
    status = [track(tracker, s.scan).status for s in elsewhere[:8]]
    assert "lost" in status
    assert "tracked" not in status


@pytest.mark.parametrize(
    "stamp",
    [
        lambda i: 5.0,
        lambda i: 100.0 - 0.2 * i,
        lambda i: 0.2 * i - (3600.0 if i >= 20 else 0.0),
        lambda i: 1.7e9 + 0.2 * i,
        lambda i: 0.2 * i + 0.19 * (i % 2),
        lambda i: 1.0 * (i // 5) + 0.011 * (i % 5),
    ],
    ids=["equal", "backwards", "one step back of an hour", "huge", "in pairs", "bursts of five"],
)
def test_no_clock_throws_the_tracker_off(
    turning: list[SimulatedScan], stamp: Callable[[int], float]
) -> None:
    found = follow(turning, [stamp(i) for i in range(len(turning))])
    errors = track_errors(turning, found)
    assert len(errors) == len(turning)
    assert errors[:, 0].max() < 0.06
    assert errors[:, 1].max() < 0.015


def test_the_information_is_symmetric_semidefinite_and_in_the_lasers_axes() -> None:
    # A long plain corridor, ends out of sight: only the way along it is unknown.
    lidar = replace(scanner_360(), range_max=8.0)
    world, drive = rectangle(60.0, 2.4), legs(Pose(30.0, 1.2, 0.0), (0.0, 0.6))
    found = follow(scans_of(world, drive, lidar=lidar))
    for step in found[1:]:
        np.testing.assert_allclose(step.information, step.information.T, rtol=1e-9)
        eigenvalues = np.linalg.eigvalsh(step.information)
        assert eigenvalues.min() > -1e-9 * eigenvalues.max()  # zero along what nothing observes
    assert found[-1].pose is not None
    along = np.array([math.cos(-found[-1].pose.theta), math.sin(-found[-1].pose.theta)])
    across = np.array([-along[1], along[0]])
    block = found[-1].information[:2, :2]
    assert across @ block @ across > 100.0 * (along @ block @ along)


def wandering(odometry: DriftingOdometry | None, lidar: Lidar, seed: int) -> list[SimulatedScan]:
    robot = SimulatedRobot.wandering(
        "r", rooms(2), lidar=lidar, seed=seed, duration_s=45.0, odometry=odometry
    )
    return list(robot.scans())


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize("odometry", [None, DriftingOdometry()], ids=["none", "good"])
def test_a_track_goes_on_that_turns_up_to_a_radian_from_scan_to_scan(
    odometry: DriftingOdometry | None, seed: int
) -> None:
    slow = replace(sick_lms200(), rate_hz=1.0)
    scans = wandering(odometry, slow, seed)
    found = follow(scans)
    assert all(f.status in ("first", "tracked") for f in found)
    assert track_errors(scans, found)[:, 0].max() < 0.2


@pytest.mark.parametrize(
    "odometry",
    [
        DriftingOdometry(),
        DriftingOdometry(length_scale=3.0, turn_scale=-1.0),
        DriftingOdometry(forward_sigma=1.0, sideways_sigma=1.0, heading_sigma=1.0),
        DriftingOdometry(length_scale=0.0, turn_scale=0.0, pull=0.0),
        DriftingOdometry(pull=0.5),
    ],
    ids=["good", "backwards turns", "noise", "stuck wheels", "pull"],
)
@pytest.mark.parametrize("place", ["rooms", "corridors"])
def test_no_odometry_however_wrong_makes_the_track_worse(
    odometry: DriftingOdometry, place: str
) -> None:
    if place == "rooms":
        plain = wandering(None, sick_lms200(), 3)
        scans = wandering(odometry, sick_lms200(), 3)
    else:
        drive = legs(Pose(2.0, 1.1, 0.0), (20.0, 0.0))
        robot = SimulatedRobot("r", corridors(0), sick_lms200(), drive, seed=5)
        plain = list(robot.scans())
        scans = list(replace(robot, odometry=odometry).scans())
    alone, found = track_errors(plain, follow(plain)), track_errors(scans, follow(scans))
    assert len(found) == len(scans)
    assert found[:, 0].max() < alone[:, 0].max() + 0.15
    assert found[:, 1].max() < alone[:, 1].max() + 0.01


def test_the_same_scans_give_the_same_bits(crossing: list[SimulatedScan]) -> None:
    for a, b in zip(follow(crossing), follow(crossing), strict=True):
        assert (a.status, a.pose, a.is_keyframe) == (b.status, b.pose, b.is_keyframe)
        assert a.information.tobytes() == b.information.tobytes()
