"""Angles between segments and nothing else: thesis §2.2.4, [3].

[3] F. Amigoni, S. Gasparini and M. Gini, "Scan matching without odometry information",
International Conference on Informatics in Control, Automation and Robotics (ICINCO), 2004. Each
pair of segments of one scan and each pair of the other with the same angle between them give a
possible transformation; the one with the greatest total length of overlapping segments wins.

Needs no guess.

Departures: angles run over the full turn, for segments are oriented (thesis §4.3); a pair is placed
by the intersection of its two lines and the mean of its two directions; pairs under `least_angle`
have no intersection to speak of; only the `longest` segments make pairs (all of them are
overlapped), or the count of transformations grows with the fourth power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from lineloom_core.features import ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.baselines.answer import hypothesis, nothing
from lineloom_lab.baselines.overlap import overlapping_length

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AngleOnlyConfig:
    """Parameters; metres, radians, shares 0..1.

    equal: greatest difference of two angles taken for equal. least_angle: least angle between the
    lines of a pair. longest: segments that make pairs. farthest: greatest translation tried.
    overlap_angle, overlap_distance: when two segments overlap. least_score: from which on the
    verdict is "match".
    """

    equal: float = math.radians(3.0)
    least_angle: float = math.radians(20.0)
    longest: int = 12
    farthest: float = 10.0
    overlap_angle: float = math.radians(5.0)
    overlap_distance: float = 0.15
    least_score: float = 0.56
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)


@dataclass(frozen=True, eq=False)
class _Corners:
    """Pairs of lines: their intersections (k, 2) [m], the angle from the first to the second (k,)
    and the direction half way between (k,) [rad].
    """

    places: Array
    angles: Array
    directions: Array


class AngleOnlyMatcher:
    """Transformations by equal angles, judged by overlapping length."""

    def __init__(self, config: AngleOnlyConfig | None = None) -> None:
        self.config = config or AngleOnlyConfig()

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "angle-only"

    def prepare(self, scan: Scan) -> ScanFeatures:
        """Extract lines."""
        return extract_features(scan, self.config.extraction)

    def match_prepared(self, reference: ScanFeatures, current: ScanFeatures) -> MatchResult:
        """Find T_reference_current."""
        if len(reference) < 2 or len(current) < 2:
            return nothing("fewer than two line segments in a scan")
        poses = self._transformations(self._corners(reference.lines), self._corners(current.lines))
        if len(poses) == 0:
            return nothing("no two pairs of segments enclose the same angle")
        lengths = overlapping_length(
            reference.lines,
            current.lines,
            poses,
            angle=self.config.overlap_angle,
            distance=self.config.overlap_distance,
        )
        best = int(np.argmax(lengths))
        length = float(lengths[best])
        whole = min(float(reference.lines[:, 6].sum()), float(current.lines[:, 6].sum()))
        return hypothesis(
            Pose.from_array(poses[best]),
            length / whole,
            self.config.least_score,
            checks={"overlap_m": length, "transformations": float(len(poses))},
        )

    def _corners(self, lines: Array) -> _Corners:
        """All pairs of the longest lines that meet at more than the least angle."""
        longest = np.sort(np.argsort(-lines[:, 6], kind="stable")[: self.config.longest])
        first, second = np.nonzero(~np.eye(len(longest), dtype=np.bool_))
        a, b = lines[longest[first]], lines[longest[second]]
        # (a, b) and (b, a) are one pair: the one with the positive angle stands for both.
        angles = wrap_array(b[:, 4] - a[:, 4])
        sine = np.sin(angles)
        kept = (angles > 0.0) & (np.abs(sine) > math.sin(self.config.least_angle))
        a, b, angles, sine = a[kept], b[kept], angles[kept], sine[kept]
        # n_a . p = o_a and n_b . p = o_b with n the left normals.
        x = (a[:, 5] * np.cos(b[:, 4]) - b[:, 5] * np.cos(a[:, 4])) / sine
        y = (a[:, 5] * np.sin(b[:, 4]) - b[:, 5] * np.sin(a[:, 4])) / sine
        return _Corners(np.column_stack([x, y]), angles, a[:, 4] + 0.5 * angles)

    def _transformations(self, reference: _Corners, current: _Corners) -> Array:
        """Return the poses (t, 3) that lay a pair onto a pair of the same angle."""
        difference = np.abs(reference.angles[:, None] - current.angles[None, :])
        i, j = np.nonzero(difference < self.config.equal)
        theta = wrap_array(reference.directions[i] - current.directions[j])
        c, s = np.cos(theta), np.sin(theta)
        place = current.places[j]
        x = reference.places[i, 0] - (c * place[:, 0] - s * place[:, 1])
        y = reference.places[i, 1] - (s * place[:, 0] + c * place[:, 1])
        poses = np.column_stack([x, y, theta])
        near: Array = poses[np.hypot(x, y) < self.config.farthest]
        return near
