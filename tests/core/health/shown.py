"""Scans of a simulated drive, with faults, shown to a doctor together with true poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.health import SensorDoctor
from lineloom_core.scan import Scan
from lineloom_lab.simulation import DriftingOdometry, Lidar, SimulatedRobot, World, corridors
from numpy.typing import NDArray

DATA = Path(__file__).parents[4] / "shared" / "data"
CHEAP = Lidar(
    -math.pi, math.tau / 360, 360, 0.15, 12.0, range_sigma=0.01, range_clip=0.03, rate_hz=10.0
)
SOON = 200
"""Scans after which a fault is to be named."""

Seen = tuple[Scan, Pose | None]
Fault = Callable[[Scan, int], Scan]


@cache
def drive(
    *, reach: float = 12.0, lidar: Lidar = CHEAP, world: World | None = None, seconds: float = 32.0
) -> tuple[Seen, ...]:
    robot = SimulatedRobot.wandering(
        "r",
        world or corridors(1),
        lidar=replace(lidar, range_max=min(reach, lidar.range_max)),
        seed=2,
        duration_s=seconds,
        odometry=DriftingOdometry(),
    )
    return tuple((s.scan, s.true_pose) for s in robot.scans())


def sent(
    scan: Scan,
    ranges: NDArray[np.float64],
    *,
    range_min: float | None = None,
    range_max: float | None = None,
) -> Scan:
    """The scan with other ranges, as a driver would send it: with four decimals."""
    return Scan.checked(
        np.round(ranges, 4),
        angle_min=scan.angle_min,
        angle_increment=scan.angle_increment,
        stamp=scan.stamp,
        seq=scan.seq,
        odometry=scan.odometry,
        range_min=scan.range_min if range_min is None else range_min,
        range_max=scan.range_max if range_max is None else range_max,
    )


def shown(seen: Iterable[Seen]) -> tuple[SensorDoctor, dict[str, int]]:
    """Show scans to a doctor; and after how many each finding was there first."""
    doctor, first = SensorDoctor(), dict[str, int]()
    for index, (scan, pose) in enumerate(seen):
        prepared = doctor.prepared(scan)
        placed = pose if np.isfinite(prepared.ranges).any() else None
        doctor.examine(scan, extract_features(prepared), placed, 0)
        for finding in doctor.findings():
            first.setdefault(finding.name, index)
    return doctor, first


def spoilt(fault: Fault, onset: int = 0, seen: tuple[Seen, ...] | None = None) -> list[Seen]:
    return [
        (fault(scan, i) if i >= onset else scan, pose)
        for i, (scan, pose) in enumerate(seen or drive())
    ]
