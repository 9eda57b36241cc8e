"""Pairs of simulated scans with known relative pose, for calibration and benchmarks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.simulation import Drive, FreeSpace, Lidar, Planner, World

FAR_APART = 12.0
"""Metres between the two scans of a negative pair, as in the real benchmark."""


@dataclass(frozen=True, eq=False)
class SimulatedPair:
    """Two scans of one world; negative where they were taken far from each other."""

    reference: Scan
    current: Scan
    T_reference_current: Pose
    negative: bool


def simulated_pairs(
    world: World,
    lidar: Lidar,
    rng: np.random.Generator,
    count: int,
    *,
    negative_share: float = 0.3,
    reach: float = 4.0,
    people: int = 0,
) -> Iterator[SimulatedPair]:
    """Yield `count` pairs; positives lie at most `reach` m apart, half of them turned by < 60 deg.

    people: up to so many round things (people, chairs) stand around each scan, elsewhere in the
    other: real places change between two visits.
    """
    space = FreeSpace.of(world)
    while count > 0:
        here = space.random_pose(rng)
        negative = bool(rng.random() < negative_share)
        there = _partner(space, here, rng, negative, reach)
        if there is None:
            continue
        count -= 1
        yield SimulatedPair(
            lidar.scan(world, here, rng, disks=bystanders(here, rng, people)),
            lidar.scan(world, there, rng, disks=bystanders(there, rng, people)),
            here.between(there),
            negative,
        )


def driven_pairs(
    world: World,
    lidar: Lidar,
    rng: np.random.Generator,
    count: int,
    *,
    negative_share: float = 0.3,
    reach: float = 4.0,
    people: int = 0,
    stops: int = 24,
) -> Iterator[SimulatedPair]:
    """Yield `count` pairs as a robot sees them that drives between random stops.

    Unlike a random pose, a robot looks where it goes: along corridors and through doors, and often
    comes back the other way. Half of the positives look more than 60 degrees apart.
    """
    poses = _driven_poses(FreeSpace.of(world), rng, stops)
    xy = np.array([(p.x, p.y) for p in poses])
    heading = np.array([p.theta for p in poses])
    while count > 0:
        k = int(rng.integers(len(poses)))
        negative = bool(rng.random() < negative_share)
        apart = np.hypot(*(xy - xy[k]).T)
        if negative:
            fit = np.flatnonzero(apart > FAR_APART)
        else:
            turned = np.abs(np.remainder(heading - heading[k] + math.pi, math.tau) - math.pi)
            wide = bool(rng.random() < 0.5)
            fit = np.flatnonzero((apart < reach) & ((turned > math.pi / 3) == wide))
        if len(fit) == 0:
            continue
        here, there = poses[k], poses[int(rng.choice(fit))]
        count -= 1
        yield SimulatedPair(
            lidar.scan(world, here, rng, disks=bystanders(here, rng, people)),
            lidar.scan(world, there, rng, disks=bystanders(there, rng, people)),
            here.between(there),
            negative,
        )


def _driven_poses(space: FreeSpace, rng: np.random.Generator, stops: int) -> list[Pose]:
    """Poses every 0.3 m of a drive between random stops, heading a little off the way."""
    planner = Planner(space)
    path = planner.route([space.random_point(rng) for _ in range(stops)])
    drive = Drive.along(path, space.world, radius=space.radius)
    times = np.arange(0.0, drive.duration_s, drive.duration_s * 0.3 / max(drive.length_m, 1.0))
    poses = [drive.pose_at(float(t)) for t in times]
    off = rng.normal(0.0, 0.05, len(poses))
    return [Pose(p.x, p.y, p.theta + float(e)) for p, e in zip(poses, off, strict=True)]


def _partner(
    space: FreeSpace, here: Pose, rng: np.random.Generator, negative: bool, reach: float
) -> Pose | None:
    for _ in range(100):
        there = space.random_pose(rng)
        distance = here.distance(there)
        if negative and distance > FAR_APART:
            return there
        if not negative and distance < reach:
            if rng.random() < 0.5:
                turn = rng.uniform(-math.pi / 3, math.pi / 3)
                there = Pose(there.x, there.y, here.theta + turn)
            return there
    return None


def bystanders(here: Pose, rng: np.random.Generator, most: int) -> NDArray[np.float64]:
    """Disks (k, 3) x, y, radius around a pose, none closer than 0.6 m."""
    count = int(rng.integers(0, most + 1))
    distance = rng.uniform(0.6, 5.0, count)
    bearing = rng.uniform(-math.pi, math.pi, count)
    return np.column_stack(
        [
            here.x + distance * np.cos(bearing),
            here.y + distance * np.sin(bearing),
            rng.uniform(0.08, 0.3, count),
        ]
    )
