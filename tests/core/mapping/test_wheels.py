"""Odometry helps where it is right and cannot hurt where it is wrong."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.facts.tracker import Tracked, Tracker
from lineloom_core.mapping.facts.wheels import Wheels
from lineloom_lab.simulation import (
    DriftingOdometry,
    Lidar,
    SimulatedRobot,
    SimulatedScan,
    World,
    rooms,
    scanner_360,
    sick_lms200,
)
from numpy.typing import NDArray

from tests.core.mapping.drives import legs, track, track_errors

Fault = Callable[[int, Pose, np.random.Generator], Pose]

FAULTS: dict[str, Fault] = {
    "three times too long": lambda i, p, rng: Pose(3.0 * p.x, 3.0 * p.y, p.theta),
    "turns the wrong way": lambda i, p, rng: Pose(p.x, p.y, -p.theta),
    "mirrored": lambda i, p, rng: Pose(-p.x, p.y, -p.theta),
    "frozen": lambda i, p, rng: Pose(0.0, 0.0, 0.0),
    "freezes half way": lambda i, p, rng: p if i < 20 else Pose(1.0, 2.0, 0.5),
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


@dataclass(frozen=True)
class Followed:
    """A drive, and how far off the tracker was without odometry: m and rad of each placed scan."""

    scans: list[SimulatedScan]
    alone: NDArray[np.float64]

    def is_better_than(self, fault: Fault, seed: int) -> bool:
        """Whether what the wheels say makes it worse, or loses a scan."""
        found = track_errors(self.scans, follow(faulty(self.scans, fault, seed)))
        if len(found) < len(self.alone):
            return True
        worse = found.max(axis=0) - self.alone.max(axis=0)
        return bool(worse[0] > 0.05 or worse[1] > 0.01)


@pytest.fixture(scope="module")
def drives() -> list[Followed]:
    found = []
    for seed in range(8):
        world, lidar = rooms(seed % 5), sick_lms200()
        robot = SimulatedRobot.wandering("r", world, lidar=lidar, seed=seed, duration_s=9.0)
        scans = list(robot.scans())
        found.append(Followed(scans, track_errors(scans, follow(scans))))
    return found


@pytest.mark.parametrize("fault", FAULTS)
def test_wrong_odometry_is_as_good_as_none(fault: str, drives: list[Followed]) -> None:
    worse = [seed for seed, d in enumerate(drives) if d.is_better_than(FAULTS[fault], seed)]
    print(f"odometry {fault}: as good as none on {8 - len(worse)} of 8 drives; worse: {worse}")
    assert worse == []


def room_and_corridor() -> World:
    """A room of 6 m that opens into a plain corridor, longer than any lidar here sees."""
    corners = [(0, -3), (6, -3), (6, -1.1), (60, -1.1), (60, 1.1), (6, 1.1), (6, 3), (0, 3)]
    ring = [*corners, corners[0]]
    walls = [(*a, *b) for a, b in itertools.pairwise(ring)]
    return World(np.array(walls, dtype=np.float64))


def driven_out_of_a_room(seed: int, beams: int, way: float) -> list[SimulatedScan]:
    lidar = Lidar(
        angle_min=-math.pi,
        angle_increment=math.tau / beams,
        beams=beams,
        range_min=0.1,
        range_max=8.0,
        rate_hz=5.0,
    )
    drive = legs(Pose(1.5, 0.0, 0.0), (2.0, 0.0), (0.0, 1.0), (0.0, -1.0), (way, 0.0))
    return list(SimulatedRobot("r", room_and_corridor(), lidar, drive, seed).scans())


@pytest.fixture(scope="module")
def out_of_a_room() -> list[SimulatedScan]:
    return driven_out_of_a_room(1, 720, 26.0)


def test_right_odometry_cures_the_plain_corridor() -> None:
    astray, cured = [], []
    for seed in range(8):
        scans = driven_out_of_a_room(seed, 360, 13.0)
        astray.append(track_errors(scans, follow(scans))[-1, 0] > 0.1)
        right = faulty(scans, lambda i, p, rng: p, 0)
        cured.append(track_errors(right, follow(right))[:, 0].max() < 0.1)
    print(f"plain corridor: astray on {sum(astray)} of 8 drives, with odometry {8 - sum(cured)}")
    assert sum(astray) >= 4, "nothing but the wheels can know"
    assert all(cured)


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


def test_a_jump_is_no_step_whatever_the_clock_counts_in() -> None:
    wheels, usual = Wheels(), (0.2, 0.1)
    assert wheels.plausible(Pose(1.2, 0.0, 1.0), usual, 1.0)
    assert wheels.plausible(Pose(5.0, 0.0, 0.0), usual, 10.0)
    assert wheels.believed
    assert not wheels.plausible(Pose(5.0, 0.0, 0.0), usual, 1.0)
    assert not wheels.believed


ALONG = [(0, 0), (3, 0), (0, 3), (-3, -1), (1, -3), (2, 2), (0, 0), (3, 1)]


def circle(radius: float, sides: int) -> World:
    """A round tank."""
    bearing = np.linspace(0.0, math.tau, sides + 1)
    ring = radius * np.column_stack([np.cos(bearing), np.sin(bearing)])
    return World(np.hstack([ring[:-1], ring[1:]]))


def wheels_alone(scans: list[SimulatedScan]) -> NDArray[np.float64]:
    """Error (m, rad) of the odometry of each scan, in the frame of the first one."""
    origin = scans[0].true_pose
    rows = []
    for s in scans:
        assert s.scan.odometry is not None
        off = origin.between(s.true_pose).between(s.scan.odometry)
        rows.append((math.hypot(off.x, off.y), abs(off.theta)))
    return np.array(rows)


def no_worse_than_wheels(scans: list[SimulatedScan], found: list[Tracked]) -> bool:
    """As the product promises: plus 2 cm and 5 %."""
    errors, alone = track_errors(scans, found), wheels_alone(scans)
    rms = (float(np.sqrt((e[:, 0] ** 2).mean())) for e in (errors, alone))
    return next(rms) < 1.05 * next(rms) + 0.02


def test_wheels_carry_the_heading_in_a_round_tank() -> None:
    """Its middle is known, and the heading is the wheels': it is no worse than they are."""
    lidar, no_worse = replace(scanner_360(), rate_hz=3.0), []
    for seed in range(4):
        tank = circle(4.5 + 0.3 * seed, 240)
        robot = SimulatedRobot.through(
            "r", tank, ALONG, lidar=lidar, seed=seed, odometry=DriftingOdometry()
        )
        scans = list(robot.scans())
        found = follow(scans)
        assert all(f.status in ("first", "tracked") for f in found)
        # What the map says of the heading is what is known of a step, not what noise seems to tell.
        steps = [f for f in found if f.is_keyframe][1:]
        assert np.median([max(np.linalg.eigvalsh(f.information)[0], 0.0) for f in steps]) < 1e-6
        no_worse.append(no_worse_than_wheels(scans, found))
    print(f"round tank: no worse than wheels on {sum(no_worse)} of 4 drives")
    assert sum(no_worse) >= 3


def test_wheels_carry_a_narrow_view_round_corners() -> None:
    beams, view = 120, math.radians(57.0)
    lidar = Lidar(
        angle_min=-0.5 * view,
        angle_increment=view / (beams - 1),
        beams=beams,
        range_min=0.15,
        range_max=8.0,
        rate_hz=5.0,
    )
    broken = worse = alone = 0
    for seed in range(8):
        robot = SimulatedRobot.wandering(
            "r",
            rooms(seed),
            lidar=lidar,
            seed=seed,
            duration_s=20.0,
            speed=0.3,
            turn_rate=0.8,
            odometry=DriftingOdometry(),
        )
        scans = list(robot.scans())
        found = follow(scans)
        broken += any(f.status == "lost" for f in found)
        worse += not no_worse_than_wheels(scans, found)
        without = [replace(s, scan=replace(s.scan, odometry=None)) for s in scans]
        alone += any(f.status == "lost" for f in follow(without))
    print(
        f"57 degrees: track broken on {broken} of 8 drives, {alone} without wheels; worse: {worse}"
    )
    assert broken == 0
    assert worse <= 2
    assert alone >= 1, "wheels are needed"


def test_who_is_carried_with_wheels_that_stand_still_is_not_carried_by_them() -> None:
    """Somebody lifts the robot into another room: wheels say that it stands."""
    followed = 0
    for seed in range(5):
        here, there = rooms(seed), rooms(seed + 20)
        lidar = scanner_360()
        robot = SimulatedRobot.wandering("r", here, lidar=lidar, seed=seed, duration_s=6.0)
        other = SimulatedRobot.wandering("r", there, lidar=lidar, seed=seed + 1, duration_s=6.0)
        scans = list(robot.scans())
        stands = scans[-1].true_pose
        after = [replace(s, true_pose=stands) for s in other.scans()][:3]
        driven = faulty([*scans, *after], lambda i, p, rng: p, 0)
        followed += any(f.status == "tracked" for f in follow(driven)[len(scans) :])
    assert followed == 0
