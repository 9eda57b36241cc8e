"""Lines as points with a direction, evenly spaced: what is compared with a plan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.floorplan.plan import lengths


@dataclass(frozen=True, eq=False)
class Samples:
    """n points on lines. points (n, 2) [m]; direction (n,) [rad], modulo a half turn; weight (n,):
    the length that each stands for [m]; line (n,): index of its line."""

    points: NDArray[np.float64]
    direction: NDArray[np.float64]
    weight: NDArray[np.float64]
    line: NDArray[np.int64]

    @staticmethod
    def of(lines: NDArray[np.float64], spacing: float) -> Samples:
        """Sample lines (m, 4) at most `spacing` [m] apart, each at least once, ends left out."""
        length = lengths(lines)
        counts = np.maximum(np.ceil(length / spacing), 1).astype(np.int64)
        line = np.repeat(np.arange(len(lines)), counts)
        within = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
        t = ((within + 0.5) / counts[line])[:, None]
        ends = lines[line]
        direction = np.arctan2(lines[:, 3] - lines[:, 1], lines[:, 2] - lines[:, 0])
        return Samples(
            points=ends[:, :2] * (1.0 - t) + ends[:, 2:] * t,
            direction=direction[line],
            weight=(length / counts)[line],
            line=line,
        )
