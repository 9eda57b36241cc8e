"""What the compiled matcher takes of one scan, as one argument."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ScanFeatures


class Sweep(NamedTuple):
    """Fields as in `ScanFeatures`, which numba cannot take whole."""

    lines: NDArray[np.float64]
    ends: NDArray[np.int64]
    edges: NDArray[np.float64]
    circles: NDArray[np.float64]
    points: NDArray[np.float64]
    beams: NDArray[np.int64]
    ranges: NDArray[np.float64]
    angle_min: float
    angle_increment: float

    @staticmethod
    def of(f: ScanFeatures) -> Sweep:
        """Take what the kernels need."""
        return Sweep(
            f.lines, f.ends, f.edges, f.circles, f.points, f.beams, f.ranges,
            f.angle_min, f.angle_increment,
        )  # fmt: skip


class Search(NamedTuple):
    """How wide the search is; see `MatcherConfig`."""

    rotations: int
    cells: int
    least_share: float
    pair_limit: int
    cell: float
    half: float
    reach: float
    coarse_keep: int
    fine_keep: int
    iterations: int
    per_circle: int
