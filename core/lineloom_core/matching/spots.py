"""Spots where a scan may have been taken: registered on a local map, judged by the latest scans."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.matching import _spot_kernels as _kernels
from lineloom_core.matching._sweep import Sweep
from lineloom_core.matching.free_space import TOLERANCE, TOLERANCE_SLOPE
from lineloom_core.matching.local_map import Cloud, LocalMap, Registration


class Latest(NamedTuple):
    """The latest k scans as the kernels take them, the latest first.

    ranges: (k, n), NaN where a scan has fewer beams than another. points: of all, one after the
    other; begins: (k + 1,), where each one's begin. poses: (k, 3) in the map's frame.
    """

    ranges: NDArray[np.float64]
    angle_mins: NDArray[np.float64]
    angle_increments: NDArray[np.float64]
    poses: NDArray[np.float64]
    points: NDArray[np.float64]
    begins: NDArray[np.int64]

    @staticmethod
    def of(scans: Sequence[tuple[ScanFeatures, Pose]]) -> Latest:
        """Lay scans beside each other; there must be one."""
        ranges = np.full((len(scans), max(len(f.ranges) for f, _ in scans)), np.nan)
        for row, (f, _) in zip(ranges, scans, strict=True):
            row[: len(f.ranges)] = f.ranges
        return Latest(
            ranges,
            np.array([f.angle_min for f, _ in scans]),
            np.array([f.angle_increment for f, _ in scans]),
            np.array([pose.to_array() for _, pose in scans]),
            np.concatenate([f.points for f, _ in scans]),
            np.cumsum([0, *(len(f.points) for f, _ in scans)]),
        )


@dataclass(frozen=True, slots=True)
class Spot:
    """found: registration in the map's frame. matched: share of the scan on known surfaces.

    misfit: what speaks against it (see `_spot_kernels`).
    """

    found: Registration
    matched: float
    misfit: float

    @property
    def contradicted(self) -> float:
        """What of that is walls in free space."""
        return self.misfit - _kernels.UNMATCHED * (1.0 - self.matched)

    @property
    def pose(self) -> Pose:
        """Of the laser in the map's frame."""
        return self.found.pose


@dataclass(frozen=True, eq=False)
class Spotter:
    """Judges spots for one scan. most_back: of `latest`, whose walls count in its free space."""

    local_map: LocalMap
    latest: Latest
    scan: Sweep
    cloud: Cloud
    most_back: int

    def settle(
        self, seeds: Iterable[Pose], *, gate: float = 0.35, iterations: int = 12, near: float = 0.08
    ) -> list[Spot]:
        """Where the seeds settle, in their order; of those within `near` m the first.

        Without iterations they are judged where they are.
        """
        poses = np.array([seed.to_array() for seed in seeds]).reshape(-1, 3)
        m, c = self.local_map, self.cloud
        rows = _kernels.settle_spots(
            m.index, m.surface, m.ox, m.oy, c.points, c.normals, c.weights, poses, gate,
            iterations, near, self.scan, self.latest, self.most_back, TOLERANCE, TOLERANCE_SLOPE,
        )  # fmt: skip
        total = max(float(c.weights.sum()), 1e-9)
        return [_spot(row, total) for row in rows]


def _spot(row: NDArray[np.float64], total: float) -> Spot:
    H = row[_kernels.HESSIAN : _kernels.SPOT_MATCHED].reshape(3, 3).copy()
    matched, inside, rms, misfit = row[_kernels.SPOT_MATCHED :].tolist()
    found = Registration(Pose.from_array(row[:3]), H, matched, inside, rms)
    return Spot(found, matched / total, misfit)
