"""Scans that share parallel walls only: rotation and the position across are known, the rest not.

Two scans of a corridor taken in opposite directions have nothing in common but its two walls. No
pair of non-parallel lines meets then, so the ordinary vote is empty; here the parallel lines vote
for their offset across, and free space picks the likeliest of all slides along.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.matching import _band_kernels
from lineloom_core.matching.free_space import TOLERANCE, TOLERANCE_SLOPE

ROTATIONS = 8
PER_ROTATION = 3
WINDOW = 0.15
TRIED = 6
FARTHEST_SLIDE = 5.0
SLIDE_STEP = 0.3
ITERATIONS = 4
LEAST_WEIGHT = 2.0
LEAST_MATCHED = 2.5
MOST_CONFLICT = 0.12


@dataclass(frozen=True, slots=True)
class Band:
    """A match up to a slide along `direction` [rad, reference frame, 0..pi).

    weight: metres of parallel wall that agree on the offset across (both sides count more).
    both_sides: walls of both facings take part, so the corridor's width fits as well. matched,
    conflict_share: what free space says, in metres of wall and as a share.
    """

    T_reference_current: Pose
    direction: float
    weight: float
    both_sides: bool
    matched: float
    conflict_share: float

    @property
    def convincing(self) -> bool:
        """Both walls of a corridor fit, in their distance too, and free space agrees."""
        return (
            self.both_sides
            and self.weight >= LEAST_WEIGHT
            and self.matched >= LEAST_MATCHED
            and self.conflict_share <= MOST_CONFLICT
        )

    def checks(self) -> dict[str, float]:
        """The figures behind `convincing`."""
        return {
            "band_weight_m": self.weight,
            "band_matched_m": self.matched,
            "band_conflict_share": self.conflict_share,
        }


def band_hypotheses(r: ScanFeatures, c: ScanFeatures) -> NDArray[np.float64]:
    """Rows as `_band_kernels.match_bands` gives them, best first."""
    table: NDArray[np.float64] = _band_kernels.match_bands(
        r.lines, r.ends, r.edges, r.points, r.ranges, r.angle_min, r.angle_increment,
        c.lines, c.ends, c.edges, c.points, c.ranges, c.angle_min, c.angle_increment,
        ROTATIONS, PER_ROTATION, WINDOW, TRIED, FARTHEST_SLIDE, SLIDE_STEP, ITERATIONS,
        TOLERANCE, TOLERANCE_SLOPE,
    )  # fmt: skip
    return table


def as_band(row: NDArray[np.float64]) -> Band:
    """The band that a row describes."""
    matched, conflict = float(row[5]), float(row[6])
    return Band(
        T_reference_current=Pose.from_array(row[:3]),
        direction=float(row[16]) % math.pi,
        weight=float(row[17]),
        both_sides=bool(row[18]),
        matched=matched,
        conflict_share=conflict / max(matched + conflict, 1e-9),
    )
