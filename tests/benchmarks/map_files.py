"""Maps as files, beside slow twins."""

from __future__ import annotations

import numpy as np
from lineloom_core.fusion.occupancy import Rays, rasterise
from lineloom_lab.simulation import Fleet
from numpy.typing import NDArray

from tests.benchmarks.row import Row, median_seconds

_CELL_M = 0.05
_NO_LINES = np.empty((0, 4))


def occupancy(*, quick: bool) -> list[Row]:
    """The grid of a drive through an office, per scan."""
    rays = _drive(10 if quick else 120)
    scans = len(rays.poses)
    ours = median_seconds(lambda r: rasterise(r, _NO_LINES, _CELL_M), [rays] * (1 if quick else 7))
    slow = median_seconds(sampled, [rays] * (1 if quick else 3))
    return [
        Row(
            name="map, occupancy grid, a scan of 360 beams",
            figure=1e6 * ours / scans,
            unit="µs",
            better="lower",
            goal=None,
            baseline="beams sampled every half cell, numpy",
            baseline_figure=1e6 * slow / scans,
        )
    ]


def sampled(rays: Rays) -> NDArray[np.int64]:
    """Count what beams pass by sampling them, scan by scan: the slow and obvious way."""
    ends = rays.ends()
    low = np.floor(np.vstack([ends, rays.poses[:, :2]]).min(axis=0) / _CELL_M)
    size = np.ceil(np.vstack([ends, rays.poses[:, :2]]).max(axis=0) / _CELL_M) - low + 1
    passes = np.zeros((int(size[1]), int(size[0])), dtype=np.int64)
    for i, (x, y, theta) in enumerate(rays.poses.tolist()):
        ranges = rays.ranges[rays.starts[i] : rays.starts[i + 1]]
        first, step = rays.sweeps[i]
        angles = theta + first + step * np.arange(len(ranges))
        for r, angle in zip(ranges.tolist(), angles.tolist(), strict=True):
            if np.isfinite(r):
                along = np.arange(0.0, r, 0.5 * _CELL_M)
                column = np.floor((x + along * np.cos(angle)) / _CELL_M) - low[0]
                row = np.floor((y + along * np.sin(angle)) / _CELL_M) - low[1]
                cells = np.unique((row * size[0] + column).astype(np.int64))
                passes.ravel()[cells] += 1
    return passes


def _drive(scans: int) -> Rays:
    poses, sweeps, ranges = [], [], []
    for sample in Fleet.office(seed=0, robots=1, duration_s=0.1 * scans + 1.0).scans():
        scan = sample.scan.counter_clockwise()
        poses.append(sample.true_pose.to_array())
        sweeps.append((scan.angle_min, scan.angle_increment))
        ranges.append(np.asarray(scan.ranges))
    return Rays.of(poses[:scans], sweeps[:scans], ranges[:scans])
