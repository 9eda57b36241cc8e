"""A slow lidar's sweep is straightened by how fast the robot turns meanwhile, told or not."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.sweep_turn import turn_rate_of_sweep
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import (
    Lidar,
    SimulatedRobot,
    SimulatedScan,
    office_floor,
)

RATE_HZ, TURN_RATE = 5.5, 1.82
PER_TURN = 1.0 / RATE_HZ
LIDAR = Lidar(
    angle_min=-math.pi, angle_increment=math.tau / 360, beams=360, range_min=0.15,
    range_max=12.0, range_sigma=0.01, range_clip=0.03, rate_hz=RATE_HZ,
)  # fmt: skip
SWEPT = replace(LIDAR, time_increment=PER_TURN / LIDAR.beams)


def spun(seed: int, duration_s: float, turn_rate: float = TURN_RATE) -> list[SimulatedScan]:
    """A robot that stops and turns on the spot, under a lidar that takes as long as a scan."""
    drive = SimulatedRobot.wandering(
        "r", office_floor(3), lidar=SWEPT, seed=seed, duration_s=duration_s, speed=0.3,
        turn_rate=turn_rate,
    )  # fmt: skip
    return list(drive.scans())


def off(scans: list[SimulatedScan], *, timed: bool) -> tuple[float, SiteMapper]:
    """Worst heading of a scan, against the others of its component [rad]; not less than one."""
    mapper = SiteMapper()
    for s in scans:
        increment = s.scan.time_increment if timed else 0.0
        mapper.add("r", replace(s.scan, time_increment=increment, odometry=None))
    trajectory = mapper.view().trajectories["r"]
    assert len(set(map(str, trajectory.component))) == 1
    true = np.array([s.true_pose.theta for s in scans])[trajectory.seq]
    errors = np.exp(1j * (trajectory.poses[:, 2] - true))
    return float(np.abs(np.angle(errors / np.exp(1j * np.angle(errors.mean())))).max()), mapper


@pytest.mark.parametrize("seed", [1, 3])
def test_a_robot_that_turns_on_the_spot_keeps_its_heading(seed: int) -> None:
    # By the rate of the last steps alone it was up to 114 degrees off after this drive.
    worst, _ = off(spun(seed, 60.0), timed=True)
    assert worst < np.radians(12.0)


def test_a_lidar_that_nobody_times_is_timed_by_its_bent_walls() -> None:
    scans = spun(3, 60.0, turn_rate=1.0)
    worst, mapper = off(scans, timed=False)
    (finding,) = [f for f in mapper.view().robots["r"].health if f.startswith("skew")]
    assert f"{PER_TURN:.2f} s per turn" in finding
    assert "it is corrected by that" in finding
    assert worst < np.radians(10.0)
    for s in spun(4, 10.0, turn_rate=1.0):  # mended, as it was told to be
        seq, stamp = len(scans) + s.scan.seq, scans[-1].scan.stamp + 1.0 + s.scan.stamp
        mapper.add("r", replace(s.scan, seq=seq, stamp=stamp, odometry=None))
    assert not [f for f in mapper.view().robots["r"].health if f.startswith("skew")]


def test_the_walls_of_a_single_scan_tell_a_turn_and_none_where_there_is_none() -> None:
    scans = spun(1, 40.0)
    config = MapperConfig().extraction
    errors = []
    for a, b in itertools.pairwise(scans):
        turned = a.true_pose.between(b.true_pose).theta * RATE_HZ
        said = turn_rate_of_sweep(None, a.scan, config, inverted=False)
        if abs(turned) < 0.05:
            assert said == 0.0
        elif said and abs(turned) > 0.9 * TURN_RATE:
            errors.append(abs(said - turned))
    assert len(errors) > 8
    assert np.median(errors) < 0.3
