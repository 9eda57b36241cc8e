"""Pairs of scans drawn from recorded logs, by how they lie to each other, and of derived lidars.

Of each log with poses to compare with: consecutive scans ("near"), with one skipped ("skip"), from
another time within 1.5 m and 60 degrees ("mid"), farther off or turned more ("far"), and more than
12 m apart ("neg"). All but the last share half of what they see, whatever the lidar; naive
trajectories, which drift, are asked about short ways only.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.evaluation.log_bench_files import log_files
from lineloom_lab.evaluation.log_bench_log import BenchLog, LogSource
from lineloom_lab.evaluation.pair_bench_lidars import RECORDED, DerivedLidar
from lineloom_lab.evaluation.pair_bench_sets import (
    BenchPair,
    BenchSet,
    LogOrigin,
    good_guess,
    overlap_share,
)
from lineloom_lab.evaluation.pairs import Pair, Tier

GROUPS = ("near", "skip", "mid", "far", "neg")
LEAST_OVERLAP = 0.5
_SEED = 41
_VARIANTS = ("-time-increment", "-no-person")  # the same scans as another log's
_SURE_WAY_M = 15.0
_DRIFTING = ("spin",)  # logs whose naive headings are off by 7 degrees after a turn on the spot
_LEAST_APART = 8  # scans between those of a pair that are no neighbours
_TRIES = 40  # scans looked at for each pair that is wanted
_FAR_M, _NEGATIVE_M, _MID_M, _MID_RAD = 4.0, 12.0, 1.5, math.pi / 3
_TIERS: dict[str, Tier] = {"near": "near", "skip": "near", "mid": "mid", "far": "far", "neg": "neg"}


@dataclass(frozen=True, eq=False)
class _Pass:
    """A lidar's scans that have poses: scans (n), poses (n, 3), way (n,) driven until each [m]."""

    scans: tuple[Scan, ...]
    poses: NDArray[np.float64]
    way: NDArray[np.float64]
    farthest_way: float


def log_sets(
    folder: Path | str, per_group: int, lidars: Sequence[DerivedLidar] = (RECORDED,)
) -> Iterator[BenchSet]:
    """Yield the pairs of each log and lidar, in collections "lidar, half".

    Logs without poses, or with doubtful ones, and variants of others are left out. The same
    arguments give the same pairs. Raises FileNotFoundError where there are no logs.
    """
    for source in log_files(Path(folder)):
        log = source.load()
        if log.trust not in ("reference", "pseudo") or source.name.endswith(_VARIANTS):
            continue
        seen = _pass_of(source, log)
        rows = _indices(source, seen, per_group)
        for lidar in lidars:
            yield _derived(source, seen, rows, lidar)


def _pass_of(source: LogSource, log: BenchLog) -> _Pass:
    only = log.recordings[0]
    known = np.isfinite(only.reference.sum(axis=1))
    poses = only.reference[known]
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    scans = tuple(
        scan.counter_clockwise(inverted=only.inverted)
        for scan, kept in zip(only.scans, known.tolist(), strict=True)
        if kept
    )
    way = np.concatenate([[0.0], np.cumsum(steps)])
    return _Pass(scans, poses, way, _trusted_way(source, log))


def _trusted_way(source: LogSource, log: BenchLog) -> float:
    """Return how long a way between two scans may be whose poses are compared [m]."""
    if log.trust == "reference":
        return math.inf
    return -1.0 if source.name.startswith(_DRIFTING) else _SURE_WAY_M


def _indices(source: LogSource, log: _Pass, per_group: int) -> list[tuple[str, int, int]]:
    """Draw pairs (group, reference, current) of one log."""
    rng = np.random.default_rng([_SEED, zlib.crc32(source.name.encode())])
    n = len(log.scans)
    drawn = [
        (group, int(i), int(i) + step)
        for group, step in (("near", 1), ("skip", 2))
        for i in np.sort(rng.permutation(n - step)[:per_group])
    ]
    found: dict[str, list[tuple[str, int, int]]] = {group: [] for group in GROUPS[2:]}
    for i in rng.integers(n, size=_TRIES * per_group):
        for group, others in _others(log, int(i)).items():
            if len(others) and len(found[group]) < per_group:
                j = int(rng.choice(others))
                if group == "neg" or _share(log.scans[i], log.scans[j], _between(log, i, j)):
                    found[group].append((group, int(i), j))
    return drawn + [row for rows in found.values() for row in rows]


def _others(log: _Pass, i: int) -> dict[str, NDArray[np.int64]]:
    """The scans that make a pair of each group with scan `i`."""
    distance = np.hypot(*(log.poses[:, :2] - log.poses[i, :2]).T)
    turned = np.abs((log.poses[:, 2] - log.poses[i, 2] + math.pi) % math.tau - math.pi)
    usable = np.abs(np.arange(len(log.poses)) - i) >= _LEAST_APART
    usable &= np.abs(log.way - log.way[i]) <= log.farthest_way
    mid = (distance < _MID_M) & (turned <= _MID_RAD)
    return {
        "mid": np.flatnonzero(usable & mid),
        "far": np.flatnonzero(usable & ~mid & (distance < _FAR_M)),
        "neg": np.flatnonzero(usable & (distance > _NEGATIVE_M)),
    }


def _derived(
    source: LogSource, seen: _Pass, rows: list[tuple[str, int, int]], lidar: DerivedLidar
) -> BenchSet:
    rng = np.random.default_rng([_SEED, zlib.crc32(f"{source.name} {lidar.name}".encode())])
    pairs = []
    for group, i, j in rows:
        reference, current = lidar.of(seen.scans[i], rng), lidar.of(seen.scans[j], rng)
        truth = _between(seen, i, j)
        if group != "neg" and not _share(reference, current, truth):
            continue
        overlap = overlap_share(reference, current, truth)
        pair = Pair(reference, current, _TIERS[group], truth, overlap)
        pairs.append(BenchPair(pair, group, good_guess(truth, rng)))
    name, collection = f"{source.name}, {lidar.name}", f"{lidar.name}, {source.half or 'others'}"
    return BenchSet(name, collection, tuple(pairs), LogOrigin(source.name, lidar.name, source.half))


def _between(log: _Pass, i: int, j: int) -> Pose:
    return Pose.from_array(log.poses[i]).between(Pose.from_array(log.poses[j]))


def _share(reference: Scan, current: Scan, truth: Pose) -> bool:
    """Whether half of either scan was seen by the other."""
    there = overlap_share(reference, current, truth)
    return min(there, overlap_share(current, reference, truth.inverse())) >= LEAST_OVERLAP
