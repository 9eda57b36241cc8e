"""Two sources in one stream are named, whichever they are; one source never is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.health import Finding
from lineloom_core.health.identity import IdentityCheck
from lineloom_core.health.sample import Sample
from lineloom_core.scan import Scan
from lineloom_lab.evaluation.log_bench_files import log_files
from lineloom_lab.simulation import Lidar, SimulatedRobot, office_floor

DATA = Path(__file__).parents[4] / "shared" / "data"
BARE = extract_features(
    Scan.checked(
        np.full(20, 2.0),
        angle_min=0.0,
        angle_increment=0.1,
        range_min=0.1,
        range_max=9.0,
        stamp=0.0,
    )
)
"""Features, which the check does not look at."""

FULL = Lidar(
    -math.pi, math.tau / 360, 360, range_max=12.0, range_sigma=0.01, range_clip=0.03, rate_hz=10.0
)
PART = Lidar(-2.356, 4.712 / 270, 271, range_max=20.0, range_sigma=0.01, range_clip=0.03)


@cache
def drive(seed: int) -> tuple[Scan, ...]:
    robot = SimulatedRobot.wandering("r", office_floor(3), lidar=FULL, seed=seed, duration_s=20.0)
    return tuple(simulated.scan for simulated in robot.scans())


def look(check: IdentityCheck, scan: Scan) -> None:
    check.examine(Sample(scan.counter_clockwise(), BARE, None, None, 0.1))


def said_of(scans: Iterable[Scan], severity: str = "warning") -> tuple[Finding, int] | None:
    """The first finding of this severity, or a worse one, and after how many scans it came."""
    check = IdentityCheck()
    for number, scan in enumerate(scans):
        look(check, scan)
        for finding in check.findings():
            if finding.severity in (severity, "error"):
                return finding, number
    return None


def in_turn(a: Sequence[Scan], b: Sequence[Scan], runs: int) -> list[Scan]:
    mixed: list[Scan] = []
    for start in range(0, len(a), runs):
        mixed += [*a[start : start + runs], *b[start : start + runs]]
    return mixed


@pytest.mark.parametrize("runs", [1, 4, 10])
def test_two_robots_under_one_name_are_named_soon(runs: int) -> None:
    mixed = in_turn(drive(1), drive(21), runs)
    found = said_of(mixed)
    assert found is not None
    assert found[1] < 100
    assert "two robots under one name" in found[0].message
    sure = said_of(mixed, "error")
    assert sure is not None
    assert sure[1] < 200


def test_odometry_tells_that_they_are_two_robots() -> None:
    a = [replace(s, odometry=Pose(0.01 * n, 0.0, 0.0)) for n, s in enumerate(drive(1))]
    b = [replace(s, odometry=Pose(9.0, 0.01 * n, 1.0)) for n, s in enumerate(drive(21))]
    found = said_of(in_turn(a, b, 2), "error")
    assert found is not None
    assert "so two robots send under this name" in found[0].message


@pytest.mark.parametrize(
    "second", [Pose(-0.3, 0.0, math.pi), Pose(-0.2, -0.2, -2.3), Pose(-0.3, 0.2, 0.0)]
)
@pytest.mark.parametrize("lidar", [FULL, PART], ids=["full", "part"])
def test_two_lidars_in_one_stream_are_named_soon(lidar: Lidar, second: Pose) -> None:
    world, rng = office_floor(3), np.random.default_rng(5)
    robot = SimulatedRobot.wandering("r", world, lidar=lidar, seed=2, duration_s=8.0)
    scans = [
        lidar.scan(world, robot.drive.pose_at(0.1 * n + 0.05 * k) @ mount, rng)
        for n in range(80)
        for k, mount in enumerate((Pose(0.3, 0.0, 0.0), second))
    ]
    found = said_of(scans, "error")
    assert found is not None
    assert found[1] < 50


@pytest.mark.parametrize("stride", [1, 4])
@pytest.mark.parametrize("seed", [1, 21])
def test_one_robot_is_left_in_peace(seed: int, stride: int) -> None:
    assert said_of(drive(seed)[::stride]) is None


def test_a_spoilt_scan_now_and_then_is_no_second_source() -> None:
    rng, scans = np.random.default_rng(3), list(drive(1))
    for number in range(10, len(scans), 7):
        scans[number] = replace(scans[number], ranges=rng.uniform(0.3, 9.0, 360))
    assert said_of(scans) is None


@pytest.mark.parametrize(
    "log", ["tinyslam-test_lab2", "fifty-beams", "corridor-no-person", "flat-rplidar", "csail"]
)
def test_real_recordings_are_left_in_peace(log: str) -> None:
    found = [file for file in log_files(DATA) if file.name == log] if DATA.is_dir() else []
    if not found:
        pytest.skip(f"no real data: {log} is missing")
    for recording in found[0].load().recordings:
        assert said_of(list(recording.scans)[:700]) is None


def test_it_is_stored_and_says_the_same() -> None:
    scans = in_turn(drive(1), drive(21), 2)
    check = IdentityCheck()
    for scan in scans[:100]:
        look(check, scan)
    restored = decode(encode(check), IdentityCheck)
    for scan in scans[100:160]:
        look(check, scan)
        look(restored, scan)
    assert restored.findings() == check.findings() != []
