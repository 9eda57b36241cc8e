"""Iterative dual correspondence (IDC): thesis §2.1.1, [18].

[18] F. Lu and E. Milios, "Robot pose estimation in unknown environments by matching 2D range
scans", Journal of Intelligent and Robotic Systems 18, 1997. Each round pairs points twice: by the
closest point, whose least squares give the translation, and by the matching range, whose least
squares give the rotation; the window of the latter narrows.

Needs a guess. As a pose-free `Matcher` it starts from identity and can only find small motions;
`match_from` takes a guess.

Departures: the worst pairs are left out by share (the paper rejects by hidden points and a
threshold on differences, which wants the guess to be good); the current scan is thinned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from lineloom_core.features import ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lineloom_lab.baselines.answer import hypothesis, nothing
from lineloom_lab.baselines.rigid_motion import motion_of_points

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class IdcConfig:
    """Parameters; metres, radians, shares 0..1.

    window, narrowing: the matching-range rule looks +-window about a point's bearing, times
    exp(-narrowing) each round (the paper's B_omega). gate: greatest distance of a pair. kept:
    share of the pairs, nearest first, that enter the least squares. iterations: rounds at most.
    most_points: the current scan is thinned evenly to so many. explained: distance under which a
    point counts for the score. least_score: from which on the verdict is "match".
    """

    window: float = math.radians(20.0)
    narrowing: float = 0.1
    gate: float = 1.0
    kept: float = 0.8
    iterations: int = 40
    most_points: int = 180
    explained: float = 0.06
    least_score: float = 0.78
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)


@dataclass(frozen=True, eq=False)
class PointScan:
    """The points of a sweep, surface by surface, ready for both rules.

    points (n, 2) [m] in the laser frame and their search tree (None without points); follows (n,):
    True where the next point lies on the same surface.
    """

    points: Array
    tree: cKDTree | None
    follows: NDArray[np.bool_]

    @staticmethod
    def of(features: ScanFeatures) -> PointScan:
        """Index the points of a sweep."""
        points = features.points
        return PointScan(points, cKDTree(points) if len(points) else None, ~features.breaks)


class IdcMatcher:
    """Lu's and Milios's two correspondences, in turn."""

    def __init__(self, config: IdcConfig | None = None) -> None:
        self.config = config or IdcConfig()

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "idc"

    def prepare(self, scan: Scan) -> PointScan:
        """Take the points of a sweep and which of them are neighbours on one surface."""
        return PointScan.of(extract_features(scan, self.config.extraction))

    def match_prepared(self, reference: PointScan, current: PointScan) -> MatchResult:
        """Find T_reference_current starting from identity."""
        return self.match_from(reference, current, Pose.identity())

    def match_from(self, reference: PointScan, current: PointScan, guess: Pose) -> MatchResult:
        """Find T_reference_current starting from `guess`."""
        if len(reference.points) < 3 or len(current.points) < 3:
            return nothing("fewer than three points in a scan")
        stride = math.ceil(len(current.points) / self.config.most_points)
        points = current.points[::stride]
        pose, window = guess, self.config.window
        for _ in range(self.config.iterations):
            moved = pose.transform(points)
            by_distance = self._motion(moved, closest_points(reference, moved))
            by_range = self._motion(moved, matching_ranges(reference, moved, pose, window))
            if by_distance is None or by_range is None:
                return nothing("fewer than three pairs of points lie within the gate")
            # The paper's rule: translation from the closest points, rotation from the ranges.
            pose, step = _combined(pose, by_distance, by_range)
            window *= math.exp(-self.config.narrowing)
            if step < 3e-4:
                break
        moved = pose.transform(points)
        distance = np.linalg.norm(closest_points(reference, moved) - moved, axis=1)
        near = distance < self.config.explained
        score = float(np.mean(near))
        rms = math.sqrt(float(np.mean(distance[near] ** 2))) if near.any() else 0.0
        return hypothesis(
            pose, score, self.config.least_score, checks={"explained_share": score, "rms": rms}
        )

    def _motion(self, moved: Array, partners: Array) -> Pose | None:
        """Least squares over the nearest of the pairs within the gate."""
        distance = np.linalg.norm(partners - moved, axis=1)
        inside = np.flatnonzero(distance < self.config.gate)
        count = math.ceil(self.config.kept * len(inside))
        if count < 3:
            return None
        best = inside[np.argsort(distance[inside], kind="stable")[:count]]
        return motion_of_points(moved[best], partners[best])


def closest_points(reference: PointScan, moved: Array) -> Array:
    """Return for each point (n, 2) the closest point of the reference's surfaces, (n, 2) [m].

    Surfaces are interpolated between neighbouring points, as in the paper.
    """
    if reference.tree is None:
        raise ValueError("the reference has no points")
    _, nearest = reference.tree.query(moved)
    best = reference.points[nearest]
    squared = np.sum((best - moved) ** 2, axis=1)
    last = len(reference.points) - 1
    for first in (nearest - 1, nearest):
        start = np.clip(first, 0, last)
        end = np.minimum(start + 1, last)
        joined = (first >= 0) & reference.follows[start] & (end > start)
        base, along = reference.points[start], reference.points[end] - reference.points[start]
        length = np.maximum(np.sum(along**2, axis=1), 1e-12)
        share = np.clip(np.sum((moved - base) * along, axis=1) / length, 0.0, 1.0)
        foot = base + share[:, None] * along
        distance = np.sum((foot - moved) ** 2, axis=1)
        better = joined & (distance < squared)
        best = np.where(better[:, None], foot, best)
        squared = np.where(better, distance, squared)
    return np.asarray(best, dtype=np.float64)


def matching_ranges(
    reference: PointScan, moved: Array, pose: Pose, window: float, most_points: int = 360
) -> Array:
    """Return for each point (n, 2) the reference point of nearest range within +-window [rad].

    (n, 2) [m]; NaN where the reference has no point in that window. Ranges and bearings are taken
    about the current scan's position under `pose`, not the reference's: about it a scan that is
    only turned too far keeps every range, however far the guess has already moved it. The reference
    is thinned evenly to `most_points`.
    """
    centre = pose.to_array()[:2]
    known = reference.points[:: math.ceil(len(reference.points) / most_points)]
    arm, target = moved - centre, known - centre
    ranges, target_ranges = np.linalg.norm(arm, axis=1), np.linalg.norm(target, axis=1)
    product = np.maximum(ranges[:, None] * target_ranges[None, :], 1e-12)
    dot = arm[:, :1] * target[:, 0] + arm[:, 1:] * target[:, 1]
    inside = dot >= math.cos(window) * product
    cost = np.where(inside, np.abs(target_ranges[None, :] - ranges[:, None]), np.inf)
    nearest = np.argmin(cost, axis=1)
    found = np.isfinite(cost[np.arange(len(moved)), nearest])
    return np.where(found[:, None], known[nearest], np.nan)


def _combined(pose: Pose, by_distance: Pose, by_range: Pose) -> tuple[Pose, float]:
    """Return the next pose and how far it went (metres plus radians)."""
    position = by_distance.transform(pose.to_array()[:2])
    shift = math.hypot(position[0] - pose.x, position[1] - pose.y)
    turned = Pose(float(position[0]), float(position[1]), pose.theta + by_range.theta)
    return turned, shift + abs(by_range.theta)
