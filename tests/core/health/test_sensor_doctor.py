"""The sensor doctor: every simulated fault is named, and sound sensors are left in peace."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.health import Finding, SensorDoctor, without_skew
from lineloom_core.io.carmen import read_carmen
from lineloom_core.mapping.facts.tracker import Tracker
from lineloom_core.matching.local_map import Cloud
from lineloom_core.scan import Mount, Scan
from lineloom_lab.simulation import (
    DriftingOdometry,
    Lidar,
    SimulatedRobot,
    World,
    column_corridor,
    office_floor,
    round_hall,
    sick_lms200,
)
from lineloom_lab.simulation.sensor_faults import (
    Fault,
    faulty,
    frozen_from,
    in_millimetres,
    reversed_beams,
    with_blocked_sector,
    with_frozen_clock,
    with_increment,
    with_own_part,
)

DATA = Path(__file__).parents[4] / "shared" / "data"
FULL_TURN = Lidar(-math.pi, math.tau / 360, 360, range_sigma=0.01, range_clip=0.03)


@cache
def drive(
    *, lidar: Lidar = FULL_TURN, seed: int = 1, odometry: bool = False, inverted: bool = False
) -> tuple[Scan, ...]:
    """A robot for 75 s through an office."""
    wheels = DriftingOdometry() if odometry else None
    robot = SimulatedRobot.wandering(
        "r", office_floor(2), lidar=lidar, seed=seed, duration_s=75.0, odometry=wheels
    )
    robot = replace(robot, mount=Mount(inverted=inverted))
    return tuple(simulated.scan for simulated in robot.scans())


def spoiled(fault: Fault, *, odometry: bool = False) -> list[Scan]:
    return [fault(scan) for scan in drive(odometry=odometry)]


def examined(scans: Iterable[Scan]) -> SensorDoctor:
    """Track scans as the mapper does, and show each to a doctor."""
    doctor, tracker, track = SensorDoctor(), Tracker(), 0
    for raw in scans:
        scan = raw.counter_clockwise()
        features = extract_features(doctor.prepared(scan))
        pose: Pose | None = None
        if len(features.points):
            tracked = tracker.track(features, Cloud.of(features), scan.stamp, scan.odometry)
            if tracked.status == "lost":
                tracker, track = Tracker(), track + 1
                tracked = tracker.track(features, Cloud.of(features), scan.stamp, scan.odometry)
            pose = tracked.pose
        doctor.examine(scan, features, pose, track)
    return doctor


def only(doctor: SensorDoctor) -> Finding:
    assert len(doctor.findings()) == 1, doctor.findings()
    return doctor.findings()[0]


@pytest.mark.parametrize(
    ("lidar", "odometry"),
    [
        pytest.param(FULL_TURN, False, id="full turn"),
        pytest.param(sick_lms200(), True, id="half turn and wheels"),
        pytest.param(FULL_TURN, True, id="full turn and wheels", marks=pytest.mark.long),
        pytest.param(sick_lms200(), False, id="half turn", marks=pytest.mark.long),
    ],
)
def test_a_sound_sensor_is_left_in_peace(lidar: Lidar, odometry: bool) -> None:
    doctor = examined(drive(lidar=lidar, odometry=odometry))
    assert doctor.findings() == ()
    assert doctor.trustworthy


@pytest.mark.parametrize("world", [round_hall(1), column_corridor(1)], ids=lambda w: w.name)
def test_round_walls_and_columns_are_no_bent_walls(world: World) -> None:
    robot = SimulatedRobot.wandering("r", world, lidar=sick_lms200(), seed=1, duration_s=80.0)
    assert examined(simulated.scan for simulated in robot.scans()).findings() == ()


@pytest.mark.parametrize("log", ["mit-csail/mit-csail.clf", "fr079/fr079.log"])
def test_real_lidars_are_left_in_peace(log: str) -> None:
    """SICKs between curved walls, among people, with stamps that repeat."""
    if not (DATA / log).is_file():
        pytest.skip(f"no real data: {DATA / log} is missing")
    scans = list(read_carmen(DATA / log))[:2000]
    doctor = examined(replace(scan, odometry=None) for scan in scans)
    assert doctor.findings() == ()


def test_the_dead_edges_of_a_real_hokuyo_are_seen() -> None:
    """The first 15 degrees of the tinyslam lidar hold zeros in every scan of all runs."""
    run = DATA / "tinyslam" / "exp1.dat"
    if not run.is_file():
        pytest.skip(f"no real data: {run} is missing")
    found = only(examined(hokuyo(run)))
    assert (found.name, found.severity) == ("blocked-sector", "note")
    assert "-120 to -" in found.message


def hokuyo(run: Path) -> Iterable[Scan]:
    for seq, line in enumerate(run.read_text().splitlines()):
        words = line.split()
        ranges = np.array(words[24 : 24 + 682], dtype=float) / 1000.0
        ranges[ranges < 0.02] = np.nan
        yield Scan.checked(
            ranges,
            angle_min=math.radians(-120.0),
            angle_increment=math.radians(240.0) / 681,
            range_min=0.02,
            range_max=5.6,
            stamp=float(words[0]) * 1e-6,
            seq=seq,
        )


def test_millimetres_are_named_and_not_trusted() -> None:
    doctor = examined(spoiled(in_millimetres)[:12])
    found = only(doctor)
    assert (found.name, found.severity) == ("units", "error")
    assert "millimetres" in found.message
    assert not doctor.trustworthy


def test_millimetres_beyond_a_range_max_in_metres_look_like_nothing_at_all() -> None:
    scans = [
        Scan.checked(
            1000.0 * scan.ranges,
            angle_min=scan.angle_min,
            angle_increment=scan.angle_increment,
            range_min=0.05,
            range_max=30.0,
            stamp=scan.stamp,
        )
        for scan in drive()[:25]
    ]
    found = only(examined(scans))
    assert (found.name, found.severity) == ("no-returns", "warning")
    assert "millimetres" in found.message


@pytest.mark.parametrize(
    "share", [0.95, 1.05, *(pytest.param(share, marks=pytest.mark.long) for share in (0.9, 1.1))]
)
def test_a_wrong_increment_bends_walls(share: float) -> None:
    """A lidar of half a turn: a full one could not claim more."""
    scans = [with_increment(share)(scan) for scan in drive(lidar=sick_lms200())]
    doctor = examined(scans)
    found = only(doctor)
    assert (found.name, found.severity) == ("angle-increment", "error")
    assert ("too large" if share > 1.0 else "too small") in found.message
    named = float(found.message.split("near ")[1].split()[0])
    assert named == pytest.approx(sick_lms200().angle_increment, rel=0.03)
    assert not doctor.trustworthy


@pytest.mark.parametrize("fault", [reversed_beams, None], ids=["reversed", "upside down"])
def test_a_mirrored_lidar_turns_against_the_wheels(fault: Fault | None) -> None:
    scans = spoiled(fault, odometry=True) if fault else drive(odometry=True, inverted=True)
    doctor = examined(scans)
    found = only(doctor)
    assert (found.name, found.severity) == ("mirrored", "warning")
    assert doctor.trustworthy  # it may be the wheels: odometry must not keep a robot from merging


def test_without_wheels_a_mirror_image_is_as_good_as_the_truth() -> None:
    assert examined(spoiled(reversed_beams)).findings() == ()


def test_scans_that_turn_half_as_far_as_the_wheels_are_named() -> None:
    scans = [
        replace(s, odometry=Pose(s.odometry.x, s.odometry.y, 2.0 * s.odometry.theta))
        for s in drive(odometry=True)
        if s.odometry is not None
    ]
    assert only(examined(scans)).name == "turn-scale"


def test_what_moves_along_is_named_and_left_out() -> None:
    doctor = examined(spoiled(with_own_part(0.9, 0.15, 0.3)))
    found = only(doctor)
    assert (found.name, found.severity) == ("self-hits", "warning")
    assert "0.30 m away at 4" in found.message
    scan = with_own_part(0.9, 0.15, 0.3)(drive()[0])
    left_out = np.isnan(doctor.prepared(scan).ranges)
    assert 6 <= left_out.sum() <= 10
    assert np.all(scan.ranges[left_out] == 0.3)


def test_a_blocked_sector_is_named() -> None:
    doctor = examined(spoiled(with_blocked_sector(0.9, 0.4)))
    found = only(doctor)
    assert (found.name, found.severity) == ("blocked-sector", "note")
    assert "41 to 63 degrees" in found.message
    assert doctor.prepared(drive()[0]) is drive()[0]


def test_clocks_that_stand_still_or_go_back_are_named() -> None:
    still = only(examined(spoiled(with_frozen_clock(3))[:120]))
    assert still.name == "clock"
    assert "earlier" not in still.message
    back = [replace(scan, stamp=-scan.stamp) for scan in drive()[:50]]
    assert "an earlier one" in only(examined(back)).message


def test_a_single_odd_stamp_is_nothing() -> None:
    scans = [replace(s, stamp=s.stamp - (0.3 if i == 40 else 0.0)) for i, s in enumerate(drive())]
    assert examined(scans[:120]).findings() == ()


def test_a_frozen_scan_is_named_and_forgotten_when_it_moves_again() -> None:
    frozen = spoiled(frozen_from(60))[:90]
    doctor = examined(frozen)
    assert only(doctor).name == "frozen"
    thawed = examined([*frozen, *drive()[90:100]])
    assert thawed.findings() == ()


def test_turning_during_the_sweep_is_named_and_mended_where_beams_are_timed() -> None:
    """At 5 Hz a full turn takes 0.2 s: turning at 1 rad/s, ends are 11 degrees off."""
    swept = drive(lidar=replace(FULL_TURN, time_increment=0.2 / 360))
    untimed = [replace(scan, time_increment=0.0) for scan in swept]
    found = only(examined(untimed))
    assert (found.name, found.severity) == ("skew", "warning")
    assert "time_increment" in found.message


def test_taking_the_skew_out_puts_beams_where_they_were() -> None:
    """A lidar that only turns: each beam's true bearing is known."""
    world, rate = office_floor(2), 0.8
    start = SimulatedRobot.wandering("r", world, lidar=FULL_TURN, duration_s=1.0).drive.start
    for inverted in (False, True):
        lidar = replace(FULL_TURN, time_increment=0.2 / 360, range_sigma=0.0)
        scan = lidar.scan(
            world,
            start,
            np.random.default_rng(0),
            inverted=inverted,
            pose_after=lambda s: start @ Pose(0.0, 0.0, rate * s),
        )
        mended = without_skew(scan, rate, inverted=inverted).counter_clockwise(inverted=inverted)
        x, y = start.transform(mended.points()).T
        walls = np.array([world.clearance(a, b, cap=1.0) for a, b in zip(x, y, strict=True)])
        as_sent = start.transform(scan.counter_clockwise(inverted=inverted).points())
        before = np.array([world.clearance(a, b, cap=1.0) for a, b in as_sent])
        assert np.percentile(walls, 90) < 0.03
        assert np.percentile(before, 90) > 0.1
    assert without_skew(replace(scan, time_increment=0.0), rate).angle_increment > 0.0


def test_a_doctor_is_stored_and_says_the_same() -> None:
    scans = spoiled(with_own_part(0.9, 0.15, 0.3))
    halfway = decode(encode(examined(scans[:200])), SensorDoctor)
    whole = examined(scans[:200])
    assert encode(halfway) == encode(whole)
    assert len(encode(whole)) < 60_000


def test_faults_pass_the_truth_through() -> None:
    robot = SimulatedRobot.wandering("r", office_floor(2), lidar=FULL_TURN, duration_s=2.0)
    for sound, spoilt in zip(robot.scans(), faulty(robot.scans(), in_millimetres), strict=True):
        assert spoilt.true_pose == sound.true_pose
        np.testing.assert_allclose(spoilt.scan.ranges, 1000.0 * sound.scan.ranges)
