"""Maps of a known building without a mapper: scans along a way, at their true poses.

What a mapper would make of them but for its errors; a test adds those that it wants.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from lineloom_core.features import ExtractionConfig, extract_features
from lineloom_core.features._kernels import VAR_OFFSET
from lineloom_core.fusion import LineObservations, fuse
from lineloom_core.fusion.occupancy import OccupancyGrid, Rays, rasterise
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import Fleet, World
from numpy.typing import NDArray

APART_M = 0.6


@dataclass(frozen=True, eq=False)
class Survey:
    """lines (n, 4) and grid in the map's frame; T_world_map: the truth."""

    lines: NDArray[np.float64]
    grid: OccupancyGrid
    T_world_map: Pose


def survey(
    world: World, T_world_map: Pose, *, seed: int = 0, duration_s: float = 150.0, robots: int = 1
) -> Survey:
    """Drive through a world and fuse what was seen, in a frame of the map's own."""
    fleet = Fleet.touring(world, robots=robots, seed=seed, duration_s=duration_s)
    T_map_world = T_world_map.inverse()
    last: dict[str, Pose] = {}
    lines, sigmas, poses, sweeps, ranges = [], [], [], [], []
    for sample in fleet.scans():
        before = last.get(sample.robot)
        if before is not None and before.distance(sample.true_pose) < APART_M:
            continue
        last[sample.robot] = sample.true_pose
        scan = sample.scan.counter_clockwise()
        found = extract_features(scan, ExtractionConfig()).lines
        T = T_map_world @ sample.true_pose
        lines.append(T.transform(found[:, :4].reshape(-1, 2)).reshape(-1, 4))
        sigmas.append(np.sqrt(found[:, VAR_OFFSET]))
        poses.append(T.to_array())
        sweeps.append((scan.angle_min, scan.angle_increment))
        ranges.append(np.asarray(scan.ranges))
    walls = fused(np.vstack(lines), np.concatenate(sigmas))
    return Survey(walls, rasterise(Rays.of(poses, sweeps, ranges), walls, 0.1), T_world_map)


def fused(lines: NDArray[np.float64], sigma: NDArray[np.float64]) -> NDArray[np.float64]:
    n = len(lines)
    observations = LineObservations(
        endpoints=lines,
        sigma=sigma,
        weight=np.ones(n),
        keyframe=np.arange(n),
        robot=np.zeros(n, dtype=np.int64),
        stamp=np.zeros(n),
        id=np.arange(n),
    )
    return np.asarray(fuse(observations).endpoints)
