"""Odometry helps where it is right and cannot hurt where it is wrong."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.facts.tracker import Tracked, Tracker
from lineloom_core.mapping.facts.wheels import Wheels
from lineloom_lab.simulation import Lidar, SimulatedRobot, SimulatedScan, World, rooms, sick_lms200

from tests.core.mapping.drives import legs, track, track_errors

Fault = Callable[[int, Pose, np.random.Generator], Pose]

FAULTS: dict[str, Fault] = {
    "three times too long": lambda i, p, rng: Pose(3.0 * p.x, 3.0 * p.y, p.theta),
    "turns the wrong way": lambda i, p, rng: Pose(p.x, p.y, -p.theta),
    "mirrored": lambda i, p, rng: Pose(-p.x, p.y, -p.theta),
    "frozen": lambda i, p, rng: Pose(0.0, 0.0, 0.0),
    "freezes half way": lambda i, p, rng: p if i < 60 else Pose(1.0, 2.0, 0.5),
    "jumps": lambda i, p, rng: Pose(p.x + 5.0 * (i // 25), p.y - 3.0 * (i // 40), p.theta),
    "metres of noise": lambda i, p, rng: Pose(*(p.to_array() + rng.normal(size=3)).tolist()),
    "absurd": lambda i, p, rng: Pose(1e12 * (-1) ** i, 1e-300, 100.0 * i),
}


def faulty(scans: list[SimulatedScan], fault: Fault, seed: int) -> list[SimulatedScan]:
    rng, origin = np.random.default_rng(seed), scans[0].true_pose
    return [
        replace(s, scan=replace(s.scan, odometry=fault(i, origin.between(s.true_pose), rng)))
        for i, s in enumerate(scans)
    ]


def follow(scans: list[SimulatedScan]) -> list[Tracked]:
    tracker = Tracker()
    return [track(tracker, s.scan) for s in scans]


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize("fault", FAULTS)
def test_wrong_odometry_is_as_good_as_none(fault: str, seed: int) -> None:
    robot = SimulatedRobot.wandering("r", rooms(2), lidar=sick_lms200(), seed=seed, duration_s=30.0)
    scans = list(robot.scans())
    alone = track_errors(scans, follow(scans))
    found = track_errors(scans, follow(faulty(scans, FAULTS[fault], seed)))
    assert len(found) == len(alone)
    assert found[:, 0].max() < alone[:, 0].max() + 0.05
    assert found[:, 1].max() < alone[:, 1].max() + 0.01


def room_and_corridor() -> World:
    """A room of 6 m that opens into a plain corridor, longer than any lidar here sees."""
    corners = [(0, -3), (6, -3), (6, -1.1), (60, -1.1), (60, 1.1), (6, 1.1), (6, 3), (0, 3)]
    ring = [*corners, corners[0]]
    walls = [(*a, *b) for a, b in itertools.pairwise(ring)]
    return World(np.array(walls, dtype=np.float64))


@pytest.fixture(scope="module")
def out_of_a_room() -> list[SimulatedScan]:
    lidar = Lidar(
        angle_min=-math.pi,
        angle_increment=math.tau / 720,
        beams=720,
        range_min=0.1,
        range_max=8.0,
        rate_hz=5.0,
    )
    drive = legs(Pose(1.5, 0.0, 0.0), (2.0, 0.0), (0.0, 1.0), (0.0, -1.0), (26.0, 0.0))
    return list(SimulatedRobot("r", room_and_corridor(), lidar, drive, seed=1).scans())


def test_right_odometry_cures_the_plain_corridor(out_of_a_room: list[SimulatedScan]) -> None:
    alone = track_errors(out_of_a_room, follow(out_of_a_room))
    right = faulty(out_of_a_room, lambda i, p, rng: p, 0)
    found = track_errors(right, follow(right))
    assert alone[-1, 0] > 0.5  # nothing but the wheels can know
    assert found[:, 0].max() < 0.3


@pytest.mark.parametrize("fault", ["three times too long", "turns the wrong way", "mirrored"])
def test_what_the_room_has_shown_to_be_wrong_is_not_asked_in_the_corridor(
    out_of_a_room: list[SimulatedScan], fault: str
) -> None:
    alone = track_errors(out_of_a_room, follow(out_of_a_room))
    wrong = faulty(out_of_a_room, FAULTS[fault], 0)
    found = track_errors(wrong, follow(wrong))
    assert len(found) == len(alone)
    assert found[-1, 0] < alone[-1, 0] + 0.1


def test_credit_is_lost_at_once_and_earned_slowly() -> None:
    wheels, step = Wheels(), Pose(0.2, 0.0, 0.0)
    assert wheels.believed
    wheels.compare(Pose(0.6, 0.0, 0.0), step, None)
    assert not wheels.believed
    for _ in range(4):
        wheels.compare(step, step, None)
    assert not wheels.believed
    wheels.compare(step, step, None)
    assert wheels.believed


def test_where_nothing_is_seen_nothing_is_earned_or_lost() -> None:
    wheels = Wheels()
    wheels.compare(Pose(0.6, 0.0, 0.0), Pose(0.2, 0.0, 0.0), 0.0)  # the difference is unseen
    assert wheels.believed
    wheels.compare(Pose(0.6, 0.0, 0.0), Pose(0.2, 0.0, 0.0), math.pi / 2)
    assert not wheels.believed
    for _ in range(30):
        wheels.compare(Pose(0.2, 0.0, 0.0), Pose(0.2, 0.0, 0.0), 0.0)
    assert not wheels.believed


def test_a_jump_is_no_step() -> None:
    wheels = Wheels()
    assert wheels.plausible(Pose(0.5, 0.0, 1.0), 1.0)
    assert wheels.believed
    assert not wheels.plausible(Pose(5.0, 0.0, 0.0), 0.1)
    assert not wheels.believed
