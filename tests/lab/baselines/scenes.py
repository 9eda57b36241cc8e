"""Seeded scans of furnished rooms, and all baselines by name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.matching import Matcher, MatchResult
from lineloom_core.scan import Scan
from lineloom_lab import baselines
from lineloom_lab.evaluation.pose_error import pose_error
from lineloom_lab.simulation import Lidar, scanner_360, sick_lms200, world_named

ITERATIVE: tuple[Matcher[Any], ...] = (baselines.PointToLineMatcher(), baselines.IdcMatcher())
POSE_FREE: tuple[Matcher[Any], ...] = (
    baselines.AngleHistogramMatcher(),
    baselines.CommonSubgraphMatcher(),
    baselines.CompleteLinesMatcher(),
    baselines.AngleOnlyMatcher(),
    baselines.GeometricHashingMatcher(),
)
ALL = (*ITERATIVE, *POSE_FREE)

STANDPOINTS = (Pose(3.0, 2.5, 0.3), Pose(10.5, 7.0, -1.0), Pose(2.8, 7.2, -1.2))
"""Inside three of the rooms of world `rooms`, seed 1."""


def scans(
    here: Pose, motion: Pose, *, lidar: Lidar | None = None, seed: int = 5
) -> tuple[Scan, Scan]:
    """Two noisy scans of the rooms: from `here` and from `motion` further on."""
    world, rng = world_named("rooms", 1), np.random.default_rng(seed)
    scanner = lidar or scanner_360()
    return scanner.scan(world, here, rng), scanner.scan(world, here @ motion, rng)


def half_turn_scans(here: Pose, motion: Pose) -> tuple[Scan, Scan]:
    """The same with the thesis's lidar of 180 degrees."""
    return scans(here, motion, lidar=sick_lms200())


def is_near(result: MatchResult, truth: Pose, metres: float, degrees: float) -> bool:
    """Tell whether the best hypothesis is within the given distance of the truth."""
    if result.best is None:
        return False
    error = pose_error(result.best, truth)
    return error.translation < metres and error.rotation < math.radians(degrees)


def name_of(matcher: Matcher[Any]) -> str:
    """Name test cases by their matcher."""
    return matcher.name
