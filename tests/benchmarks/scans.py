"""What the benchmarks run on; simulated where the real data is not there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from lineloom_core.io.carmen import read_carmen
from lineloom_core.scan import Scan
from lineloom_lab.evaluation import load_pairs
from lineloom_lab.evaluation.simulated_pairs import simulated_pairs
from lineloom_lab.simulation import FreeSpace, Lidar, office_floor, sick_lms200

ScanPair = tuple[Scan, Scan]

DATA = Path(__file__).parents[3] / "shared" / "data"
"""Folder of the real data."""


def office_scans(lidar: Lidar, count: int) -> list[Scan]:
    """Scans from random places on an office floor."""
    world, rng = office_floor(1), np.random.default_rng(7)
    space = FreeSpace.of(world)
    return [lidar.scan(world, space.random_pose(rng), rng) for _ in range(count)]


def office_pairs(count: int) -> list[ScanPair]:
    """Pairs of 181-beam scans on an office floor, three in ten of different places."""
    rng = np.random.default_rng(3)
    pairs = simulated_pairs(office_floor(2), sick_lms200(), rng, count)
    return [(pair.reference, pair.current) for pair in pairs]


def real_pairs(data: Path, every: int) -> list[ScanPair] | None:
    """Every n-th pair of both real collections (360 beams), or None without the data."""
    files = [data / "pairs" / name for name in ("fr079.npz", "mit-csail.npz")]
    if not all(file.is_file() for file in files):
        return None
    pairs = [pair for file in files for pair in load_pairs(file).pairs[::every]]
    return [(pair.reference, pair.current) for pair in pairs]


def csail(data: Path, scans: int | None = None) -> list[Scan] | None:
    """The CSAIL log without odometry (its first `scans`), or None without the data."""
    log = data / "mit-csail" / "mit-csail.clf"
    if not log.is_file():
        return None
    return [replace(scan, odometry=None) for scan in read_carmen(log)][:scans]


def driven_seconds(scans: list[Scan]) -> float:
    """Seconds of driving in a log."""
    stamps = [scan.stamp for scan in scans]
    return max(stamps) - min(stamps)
