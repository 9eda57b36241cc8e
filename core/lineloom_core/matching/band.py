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
from lineloom_core.matching.free_space import (
    TOLERANCE,
    TOLERANCE_SLOPE,
    FreeSpaceCheck,
    judge_sweeps,
)

ROTATIONS = 8
PER_ROTATION = 3
WINDOW = 0.15
TRIED = 6
FARTHEST_SLIDE = 6.0
SLIDE_STEP = 0.4
LEAST_WEIGHT = 2.0
LEAST_MATCHED = 2.5
MOST_CONFLICT = 0.12
SIGMAS = (10.0, 0.06, 0.02)  # m along, m across, rad
PHI, AXIS, ACROSS, WEIGHT, BOTH_SIDES = range(5)


@dataclass(frozen=True, slots=True)
class Band:
    """A match up to a slide along `direction` [rad, reference frame, 0..pi).

    weight: metres of parallel wall that agree on the offset across (both sides count more).
    both_sides: walls of both facings take part, so the corridor's width fits as well.
    """

    T_reference_current: Pose
    direction: float
    weight: float
    both_sides: bool
    free_space: FreeSpaceCheck

    @property
    def convincing(self) -> bool:
        """Both walls of a corridor fit, in their distance too, and free space agrees."""
        return (
            self.both_sides
            and self.weight >= LEAST_WEIGHT
            and self.free_space.matched >= LEAST_MATCHED
            and self.free_space.conflict_share <= MOST_CONFLICT
        )

    def covariance(self) -> NDArray[np.float64]:
        """3x3 over x, y, theta in the reference frame: metres along, centimetres across."""
        c, s = math.cos(self.direction), math.sin(self.direction)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        spread: NDArray[np.float64] = R @ np.diag(np.square(SIGMAS)) @ R.T
        return spread

    def checks(self) -> dict[str, float]:
        """The figures behind `convincing`."""
        return {
            "band_weight_m": self.weight,
            "band_matched_m": self.free_space.matched,
            "band_conflict_share": self.free_space.conflict_share,
        }


def best_band(reference: ScanFeatures, current: ScanFeatures) -> Band | None:
    """The band that walls and free space speak for most; None where no lines are parallel."""
    table = _band_kernels.propose_bands(
        reference.lines, current.lines, ROTATIONS, PER_ROTATION, WINDOW
    )
    best: tuple[float, int, Pose] | None = None
    for k in range(min(len(table), TRIED)):
        row = table[k]
        slid = _band_kernels.slide_band(
            reference.points, reference.ranges, reference.angle_min, reference.angle_increment,
            current.points, current.ranges, current.angle_min, current.angle_increment,
            row[PHI], row[AXIS], row[ACROSS], FARTHEST_SLIDE, SLIDE_STEP,
            TOLERANCE, TOLERANCE_SLOPE,
        )  # fmt: skip
        value = float(slid[3] + row[WEIGHT])
        if best is None or value > best[0]:
            best = value, k, Pose.from_array(slid[:3])
    if best is None:
        return None
    _, k, pose = best
    return Band(
        T_reference_current=pose,
        direction=float(np.mod(table[k, AXIS], math.pi)),
        weight=float(table[k, WEIGHT]),
        both_sides=bool(table[k, BOTH_SIDES]),
        free_space=judge_sweeps(reference, current, pose),
    )
