"""Iterative point-to-line matching: thesis §2.1.1, [8] and [12].

[8] I. J. Cox, "Blanche: an experiment in guidance and navigation of an autonomous robot vehicle",
IEEE Transactions on Robotics and Automation 7(2), 1991. [12] J.-S. Gutmann and C. Schlegel, "AMOS:
comparison of scan matching approaches for self-localization in indoor environments", EUROMICRO
1996: the lines are not a map's but the reference scan's.

Needs a guess. As a pose-free `Matcher` it starts from identity and can only find small motions;
`match_from` takes a guess.

Departures: the gate on point-to-line distances shrinks from `first_gate` to `last_gate`, since
scans from afar share only part of what they see, where Blanche's map was complete; a point must
project onto the segment (plus `margin`), else far walls pull at everything in their line.
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

from lineloom_lab.baselines.answer import hypothesis, nothing

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PointToLineConfig:
    """Parameters; metres, radians, shares 0..1.

    first_gate, last_gate, shrink: greatest distance of a point from its line, multiplied by
    `shrink` each round. margin: how far beyond a segment's ends a point may project. iterations:
    rounds at most. most_points: the current scan is thinned evenly to so many. explained: distance
    under which a point counts for the score. least_score: from which on the verdict is "match".
    """

    first_gate: float = 1.0
    last_gate: float = 0.15
    shrink: float = 0.85
    margin: float = 0.1
    iterations: int = 40
    most_points: int = 360
    explained: float = 0.06
    least_score: float = 0.74
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)


@dataclass(frozen=True, eq=False)
class _Correspondences:
    """Points (n, 2) under the present pose, with unit normals (n, 2) and offsets (n,) of their
    lines: n . p - offset is the residual [m].
    """

    points: Array
    normals: Array
    offsets: Array

    def residuals(self) -> Array:
        """Return the signed distances of the points from their lines, (n,) [m]."""
        found: Array = np.sum(self.normals * self.points, axis=1) - self.offsets
        return found

    def rms(self) -> float:
        """Return the root mean square of the residuals [m]; 0 without points."""
        return math.sqrt(float(np.mean(self.residuals() ** 2))) if len(self.points) else 0.0

    def jacobian(self, centre: Array) -> Array:
        """Return the residuals' derivatives (n, 3) by a shift and by a turn about `centre`."""
        arm = self.points - centre
        lever = self.normals[:, 1] * arm[:, 0] - self.normals[:, 0] * arm[:, 1]
        return np.column_stack([self.normals, lever])


class PointToLineMatcher:
    """Cox's iteration on the reference scan's lines."""

    def __init__(self, config: PointToLineConfig | None = None) -> None:
        self.config = config or PointToLineConfig()

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "point-to-line"

    def prepare(self, scan: Scan) -> ScanFeatures:
        """Extract lines and points."""
        return extract_features(scan, self.config.extraction)

    def match_prepared(self, reference: ScanFeatures, current: ScanFeatures) -> MatchResult:
        """Find T_reference_current starting from identity."""
        return self.match_from(reference, current, Pose.identity())

    def match_from(
        self, reference: ScanFeatures, current: ScanFeatures, guess: Pose
    ) -> MatchResult:
        """Find T_reference_current starting from `guess`."""
        if len(reference) < 2:
            return nothing("fewer than two line segments in the reference scan")
        if len(current.points) < 3:
            return nothing("fewer than three points in the current scan")
        stride = math.ceil(len(current.points) / self.config.most_points)
        points = current.points[::stride]
        pose, gate = guess, self.config.first_gate
        for _ in range(self.config.iterations):
            motion = _step(self._correspond(reference.lines, pose.transform(points), gate))
            if motion is None:
                return nothing("fewer than three points lie near lines")
            pose = motion @ pose
            settled = math.hypot(motion.x, motion.y) < 1e-4 and abs(motion.theta) < 1e-4
            if settled and gate <= self.config.last_gate:
                break
            gate = max(gate * self.config.shrink, self.config.last_gate)
        final = self._correspond(reference.lines, pose.transform(points), self.config.explained)
        score = len(final.points) / len(points)
        return hypothesis(
            pose,
            score,
            self.config.least_score,
            covariance=_covariance(final, pose),
            checks={"explained_share": score, "rms": final.rms()},
        )

    def _correspond(self, lines: Array, points: Array, gate: float) -> _Correspondences:
        """Give every point its nearest segment within `gate` [m]; drop points without one."""
        start, direction = (
            lines[:, 0:2],
            np.column_stack([np.cos(lines[:, 4]), np.sin(lines[:, 4])]),
        )
        normals = np.column_stack([-direction[:, 1], direction[:, 0]])
        along = points @ direction.T - np.sum(start * direction, axis=1)
        across = points @ normals.T - lines[:, 5]
        beyond = np.maximum(np.maximum(-along, along - lines[:, 6]), 0.0)
        distance = np.where(beyond <= self.config.margin, np.hypot(across, beyond), np.inf)
        nearest = np.argmin(distance, axis=1)
        near = distance[np.arange(len(points)), nearest] < gate
        chosen = nearest[near]
        return _Correspondences(points[near], normals[chosen], lines[chosen, 5])


def _step(found: _Correspondences) -> Pose | None:
    """Return Cox's least-squares motion, or None where there are too few points.

    Linearised in the rotation about the points' centroid c: n . (p + t + theta J (p - c)) = offset.
    A corridor fixes nothing along its walls: the least step is taken there.
    """
    if len(found.points) < 3:
        return None
    centre = found.points.mean(axis=0)
    rows = found.jacobian(centre)
    dx, dy, theta = (float(v) for v in np.linalg.lstsq(rows, -found.residuals(), rcond=1e-3)[0])
    shift = centre + np.array([dx, dy]) - Pose(0.0, 0.0, theta).transform(centre)
    return Pose(float(shift[0]), float(shift[1]), theta)


def _covariance(found: _Correspondences, pose: Pose) -> Array:
    """Return Cox's estimate s^2 (X^T X)^-1 over the pose's x, y, theta.

    A weak prior (10 m, 1 rad) lets it exist in corridors, too.
    """
    rows = found.jacobian(pose.to_array()[:2])
    variance = max(found.rms(), 0.005) ** 2
    information = rows.T @ rows / variance + np.diag([0.01, 0.01, 1.0])
    return np.asarray(np.linalg.inv(information), dtype=np.float64)
