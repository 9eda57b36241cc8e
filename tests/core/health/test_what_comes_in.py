"""What drivers get wrong is named soon, and taken out where that is safe.

Poses are given here, as tracking would find them: what is tested is what the doctor makes of scans.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.health import SensorDoctor
from lineloom_core.io.carmen import read_carmen
from lineloom_core.scan import Scan
from lineloom_lab.simulation import World, office_floor

from tests.core.health.shown import CHEAP, DATA, SOON, Fault, drive, sent, shown, spoilt


def only(doctor: SensorDoctor) -> str:
    assert len(doctor.findings()) == 1, doctor.findings()
    return str(doctor.findings()[0])


def coded(value: float, limit: float, *, noise: float = 0.0, share: float = 1.0) -> Fault:
    """No-returns as a number, in a share of the beams; where it is not, they stay what they are."""

    def fault(scan: Scan, seed: int) -> Scan:
        rng = np.random.default_rng(seed)
        none = np.isposinf(scan.ranges) & (rng.random(len(scan)) < share)
        said = value + noise * rng.standard_normal(len(scan))
        return sent(scan, np.where(none, said, scan.ranges), range_min=0.0, range_max=limit)

    return fault


@pytest.mark.parametrize(
    ("value", "limit", "onset"),
    [(29.95, 30.0, 0), (65.533, 100.0, 150), (6.0, 12.0, 0), (8.191, 8.2, 150)],
)
def test_a_constant_for_no_return_is_left_out_from_the_first_scan_on(
    value: float, limit: float, onset: int
) -> None:
    fault, seen = coded(value, limit), drive(reach=6.0)
    doctor, first = shown(spoilt(fault, onset, seen))
    assert onset <= first["no-return-code"] <= onset + 2
    assert f"{value:.4g} m" in only(doctor)
    assert doctor.trustworthy
    for scan, _ in (seen[onset], seen[-1]):
        none = np.isposinf(scan.ranges)
        wrong = fault(scan, 0)
        kept = np.isfinite(SensorDoctor().prepared(wrong).ranges)
        assert none.sum() < 5 or not np.any(kept & none)
        np.testing.assert_array_equal(np.isfinite(doctor.prepared(wrong).ranges), ~none)


@pytest.mark.parametrize(
    "fault",
    [
        coded(29.95, 30.0, share=0.4),
        coded(29.95, 30.0, noise=0.02),
        coded(7.0, 12.0, noise=0.01),
        coded(3.21, 12.0, share=0.5),
    ],
    ids=["single beams", "with noise", "near with noise", "within its reach"],
)
def test_a_code_in_single_beams_or_with_noise_takes_a_few_metres(fault: Fault) -> None:
    doctor, first = shown(spoilt(fault, 100, drive(reach=6.0)))
    assert 100 <= first["no-return-code"] < 100 + SOON
    assert only(doctor)


def test_a_range_of_nothing_is_no_return() -> None:
    scan = sent(drive()[0][0], np.zeros(360), range_min=0.0)
    assert not np.isfinite(SensorDoctor().prepared(scan).ranges).any()


def floor_at(pitch: float, bearing: float, height: float = 0.2) -> Fault:
    """A lidar that leans by `pitch` [rad] towards `bearing` sees the floor there."""

    def fault(scan: Scan, seed: int) -> Scan:
        ahead = np.cos(scan.angles - bearing)
        noise = 0.01 * np.random.default_rng(seed).standard_normal(len(scan))
        with np.errstate(divide="ignore"):
            floor = np.where(ahead > 0.05, height / (math.sin(pitch) * ahead), np.inf) + noise
        return sent(scan, np.minimum(scan.ranges, floor))

    return fault


@pytest.mark.parametrize(
    ("pitch", "bearing", "height"), [(5.0, 0.0, 0.2), (2.5, 0.0, 0.15), (6.0, 0.5, 0.3)]
)
def test_the_floor_before_a_tilted_lidar_is_named_and_cut_off(
    pitch: float, bearing: float, height: float
) -> None:
    fault = floor_at(math.radians(pitch), bearing, height)
    doctor, first = shown(spoilt(fault, 50))
    assert first["tilted"] < 50 + SOON
    assert "Level the lidar" in only(doctor)
    scan = drive()[-1][0]
    tilted = fault(scan, 1)
    kept, floor = np.isfinite(doctor.prepared(tilted).ranges), tilted.ranges < scan.ranges - 0.1
    assert np.mean(kept[floor]) < 0.1 if floor.any() else True
    assert np.mean(kept[tilted.ranges < 0.8 * height / math.sin(math.radians(pitch))]) > 0.98


@pytest.mark.parametrize("reach", [0.4, 1.2, 1.9])
def test_the_robot_s_own_parts_are_left_out_up_to_two_metres_behind(reach: float) -> None:
    def fault(scan: Scan, seed: int) -> Scan:
        behind = np.abs(scan.angles) > math.pi - 0.2
        noise = 0.01 * np.random.default_rng(seed).standard_normal(len(scan))
        return sent(scan, np.where(behind, np.minimum(scan.ranges, reach + noise), scan.ranges))

    doctor, first = shown(spoilt(fault, 60))
    assert min(first.values()) < 60 + SOON
    assert set(first) <= {"rides-along", "self-hits", "tilted"}
    left = doctor.prepared(fault(drive()[-1][0], 7)).ranges
    assert not np.any(np.abs(left - reach)[np.abs(CHEAP.angles) > math.pi - 0.15] < 0.05)


@pytest.mark.parametrize(
    ("factor", "onset"), [(0.5, 0), (0.8, 50), (1.25, 0), (1 / 0.3048, 50), (4.0, 0)]
)
def test_lengths_in_another_unit_show_against_the_wheels(factor: float, onset: int) -> None:
    def scaled(scan: Scan, seed: int) -> Scan:
        return sent(scan, factor * scan.ranges, range_min=0.0, range_max=50.0)

    seen = drive(world=office_floor(3))
    scans = spoilt(scaled, onset, seen)
    poses, at = [], Pose.identity()
    for i, ((_, a), (_, b)) in enumerate(pairwise(seen)):
        poses.append(at)
        assert a is not None
        assert b is not None
        step, k = a.between(b), factor if i >= onset else 1.0
        at = at @ Pose(k * step.x, k * step.y, step.theta)
    moved = [(scan, pose) for (scan, _), pose in zip(scans, poses, strict=False)]
    doctor, first = shown(moved)
    assert onset <= first["length-scale"] < onset + SOON
    assert not doctor.trustworthy
    assert "odometry" in only(doctor)


def test_odometry_in_millimetres_is_no_fault_of_the_ranges() -> None:
    def fault(scan: Scan, _: int) -> Scan:
        assert scan.odometry is not None
        x, y, theta = scan.odometry.to_array()
        return replace(scan, odometry=Pose(1000.0 * x, 1000.0 * y, theta))

    doctor, _ = shown(spoilt(fault))
    assert only(doctor).startswith("odometry-units: ")
    assert doctor.trustworthy


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milli"), (1e6, "micro"), (1e9, "nano")])
def test_times_in_other_units(factor: float, unit: str) -> None:
    right = 0.1 / 361

    def increments(scan: Scan, _: int) -> Scan:
        return replace(scan, time_increment=factor * right)

    doctor, first = shown(spoilt(increments))
    assert first["time-increment"] < 15
    assert f"{unit}seconds" in only(doctor)
    mended = doctor.sweep.mended(increments(drive()[0][0], 0))
    assert mended.time_increment == pytest.approx(right)
    durations, _ = shown(spoilt(lambda scan, _: replace(scan, scan_time=factor * 0.1)))
    assert only(durations).startswith("scan-time: ")
    for since in (5.0, 1.7e9):  # the robot's start, or 1970
        seen = [(replace(s, stamp=factor * (since + s.stamp)), pose) for s, pose in drive()]
        stamps, first = shown(seen)
        assert first["stamp-units"] < SOON
        assert f"{unit}seconds" in only(stamps)


def test_an_increment_that_no_unit_explains_is_not_used() -> None:
    doctor, _ = shown(spoilt(lambda scan, _: replace(scan, time_increment=0.01)))
    assert "is wrong and not used" in only(doctor)
    assert doctor.sweep.mended(replace(drive()[0][0], time_increment=0.01)).time_increment == 0.0


@pytest.mark.parametrize("jump", [1.7e9, -100.0])
def test_a_clock_that_is_set_while_the_robot_drives(jump: float) -> None:
    def late(scan: Scan, _: int) -> Scan:
        return replace(scan, stamp=scan.stamp + jump)

    doctor, first = shown(spoilt(late, 100)[:200])
    assert first == {"clock-jump": 100}
    assert only(doctor)
    assert shown(spoilt(late, 100))[0].findings() == (), "an old jump is forgotten"


def rng_of(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


USELESS: dict[str, Fault] = {
    "random": lambda scan, i: sent(scan, rng_of(i).uniform(0.2, 11.0, len(scan))),
    "shuffled": lambda scan, i: sent(scan, rng_of(i).permutation(scan.ranges)),
    "half random": lambda scan, i: sent(
        scan, np.where(rng_of(i).random(360) < 0.5, np.inf, rng_of(i).normal(4.0, 1.0, 360))
    ),
    "constant": lambda scan, _: sent(scan, np.full(len(scan), 3.0)),
    "frozen": lambda scan, _: sent(scan, drive()[0][0].ranges),
}


@pytest.mark.parametrize("kind", USELESS)
def test_nothing_is_made_of_a_sensor_that_measures_nothing(kind: str) -> None:
    fault = USELESS[kind]
    doctor, first = shown(spoilt(fault, 50)[:150])
    assert min(first.values()) < 80
    assert not np.isfinite(doctor.prepared(fault(drive()[150][0], 150)).ranges).any()
    mended = [*spoilt(fault, 50)[:150], *drive()[150:]]
    doctor, _ = shown(mended)
    assert np.isfinite(doctor.prepared(drive()[0][0]).ranges).any(), "it works again"


def test_scans_that_stand_still_while_the_wheels_drive() -> None:
    first = drive()[0][0]

    def stuck(scan: Scan, seed: int) -> Scan:
        return sent(scan, first.ranges + 0.005 * rng_of(seed).standard_normal(360))

    seen = [(scan, Pose.identity()) for scan, _ in spoilt(stuck)]
    doctor, named = shown(seen[:250])
    assert named["stuck"] < SOON
    assert "wheels turn in the air" in only(doctor)
    assert not np.isfinite(doctor.prepared(seen[0][0]).ranges).any()
    again, _ = shown([*seen[:250], *drive()[250:]])
    assert again.findings() == ()


def test_tracks_that_break_are_told_with_what_the_scans_lack() -> None:
    doctor = SensorDoctor()
    for i, (scan, pose) in enumerate(drive()[:120]):
        few = replace(scan, ranges=np.where(np.arange(len(scan)) % 9, np.nan, scan.ranges))
        doctor.examine(few, extract_features(few), pose if i % 5 else None, i // 10)
    assert "% of the beams have a return" in str(doctor.findings()[0])
    assert doctor.follows
    for scan, _ in drive()[120:180]:
        doctor.examine(scan, extract_features(scan), None, None)
    assert not doctor.follows


def test_a_wood_has_no_lines() -> None:
    rng = np.random.default_rng(4)
    at = np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), axis=-1).reshape(-1, 2) * 4.0
    at += rng.uniform(-0.6, 0.6, at.shape)
    turn = np.linspace(0.0, math.tau, 9)
    trunks = at[:, None, :] + 0.1 * np.column_stack([np.cos(turn), np.sin(turn)])
    world = World(np.concatenate([trunks[:, :-1], trunks[:, 1:]], axis=2).reshape(-1, 4), "wood")
    poses = [Pose(2.0 + 0.1 * i, 2.0, 0.0) for i in range(80)]
    doctor, _ = shown(
        (CHEAP.scan(world, pose, rng, stamp=0.1 * i), pose) for i, pose in enumerate(poses)
    )
    assert only(doctor).startswith("no-lines: ")
    assert doctor.trustworthy


@pytest.mark.parametrize("code", [79.99, 81.0])
def test_a_code_in_a_real_log_is_found(code: float) -> None:
    path = DATA / "mit-csail" / "mit-csail.clf"
    if not path.is_file():
        pytest.skip(f"no real data: {path} is missing")
    scans = [
        sent(s, np.where(np.isfinite(s.ranges), np.minimum(s.ranges, code), code), range_max=81.9)
        for s in list(read_carmen(path))[:600]
    ]
    far = next(i for i, s in enumerate(scans) if np.count_nonzero(s.ranges == code) > 10)
    _, first = shown((scan, scan.odometry) for scan in scans)
    assert far <= first["no-return-code"] < far + SOON


def test_what_was_found_is_stored() -> None:
    seen = spoilt(coded(29.95, 30.0), 50, drive(reach=6.0))[:200]
    whole, _ = shown(seen)
    assert encode(decode(encode(whole), SensorDoctor)) == encode(whole)
