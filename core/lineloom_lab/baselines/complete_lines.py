"""Complete line segments and their relative positions (CLS): thesis §2.2.4, [30].

[30] Z. Xu, J. Liu and Z. Xiang, "Scan matching based on CLS relationships", IEEE International
Conference on Robotics, Intelligent Systems and Signal Processing, 2003. A segment is complete where
both of its ends are real ends of the wall. Each pair of complete segments of one length gives a
trial localisation; the other segments speak for it where they find a counterpart with the relative
position of centres, orientation and length; the trial with the greatest likelihood wins.

Needs no guess, but enough segments that are seen from end to end.

Departures: the counter-clockwise order of segments is not used (in the paper it only saves time,
and thesis §2.2.4 shows where it fails); segments are oriented, so one trial per pair is enough; the
winner is refined by least squares over the centres of all its pairs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from lineloom_core.features import EDGE, ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.baselines.answer import hypothesis, nothing
from lineloom_lab.baselines.rigid_motion import motion_of_points

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CompleteLinesConfig:
    """Parameters; metres, radians, shares 0..1.

    length, centre, angle: greatest differences of two segments that are taken for the same one.
    least_pairs: segments, the tried one included, that must agree. least_score: from which on the
    verdict is "match".
    """

    length: float = 0.12
    centre: float = 0.2
    angle: float = math.radians(6.0)
    least_pairs: int = 2
    least_score: float = 0.55
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)


@dataclass(frozen=True, eq=False)
class CompleteLines:
    """Complete segments: centres (n, 2) [m], oriented directions (n,) [rad], lengths (n,) [m]."""

    centres: Array
    directions: Array
    lengths: Array

    def __len__(self) -> int:
        return len(self.lengths)


class CompleteLinesMatcher:
    """Trial localisations by complete segments of one length."""

    def __init__(self, config: CompleteLinesConfig | None = None) -> None:
        self.config = config or CompleteLinesConfig()

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "complete-lines"

    def prepare(self, scan: Scan) -> CompleteLines:
        """Extract lines and keep those with two real ends."""
        features = extract_features(scan, self.config.extraction)
        return complete_lines(features)

    def match_prepared(self, reference: CompleteLines, current: CompleteLines) -> MatchResult:
        """Find T_reference_current."""
        if len(reference) < 2 or len(current) < 2:
            return nothing("fewer than two complete line segments in a scan")
        difference = np.abs(reference.lengths[:, None] - current.lengths[None, :])
        trials = np.argwhere(difference <= self.config.length)
        if len(trials) == 0:
            return nothing("no two complete line segments have the same length")
        partners, likelihood = self._judge(reference, current, trials)
        best = int(np.argmax(likelihood))
        count = int(np.count_nonzero(partners[best] >= 0))
        if count < self.config.least_pairs:
            return nothing("no trial finds a second pair of complete line segments")
        j = np.flatnonzero(partners[best] >= 0)
        i = partners[best][j]
        pose = _fit(reference, current, i, j)
        score = count / min(len(reference), len(current))
        return hypothesis(
            pose,
            score,
            self.config.least_score,
            checks={"pairs": float(count), "likelihood": float(likelihood[best])},
        )

    def _judge(
        self, reference: CompleteLines, current: CompleteLines, trials: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array]:
        """Partners (t, m) of the current segments under each trial, -1 for none, and each trial's
        likelihood (t,): one for a perfect counterpart, less with its differences, summed.
        """
        i, j = trials[:, 0], trials[:, 1]
        theta = reference.directions[i] - current.directions[j]
        c, s = np.cos(theta), np.sin(theta)
        arm = current.centres[None, :, :] - current.centres[j][:, None, :]
        x = c[:, None] * arm[:, :, 0] - s[:, None] * arm[:, :, 1] + reference.centres[i, 0][:, None]
        y = s[:, None] * arm[:, :, 0] + c[:, None] * arm[:, :, 1] + reference.centres[i, 1][:, None]
        apart = np.hypot(
            x[:, :, None] - reference.centres[:, 0], y[:, :, None] - reference.centres[:, 1]
        )
        turned = np.abs(
            wrap_array(
                (current.directions[None, :] + theta[:, None])[:, :, None] - reference.directions
            )
        )
        longer = np.abs(current.lengths[:, None] - reference.lengths[None, :])[None, :, :]
        limits = self.config
        off = np.maximum(
            np.maximum(apart / limits.centre, turned / limits.angle), longer / limits.length
        )
        partners = np.argmin(off, axis=2)
        least = np.take_along_axis(off, partners[:, :, None], axis=2)[:, :, 0]
        agrees = least <= 1.0
        likelihood = np.sum(np.where(agrees, 1.0 - 0.5 * least, 0.0), axis=1)
        return np.where(agrees, partners, -1), likelihood


def complete_lines(features: ScanFeatures) -> CompleteLines:
    """Return the segments whose two ends are real ends of the wall (thesis §3.2, §4.1.1)."""
    lines = features.lines[np.all(features.ends == EDGE, axis=1)]
    return CompleteLines(0.5 * (lines[:, 0:2] + lines[:, 2:4]), lines[:, 4], lines[:, 6])


def _fit(
    reference: CompleteLines,
    current: CompleteLines,
    i: NDArray[np.int64],
    j: NDArray[np.int64],
) -> Pose:
    """Least squares over both ends of every pair, so that directions count with their length."""
    half_r = 0.5 * np.minimum(reference.lengths[i], current.lengths[j])[:, None]
    along_r = np.column_stack([np.cos(reference.directions[i]), np.sin(reference.directions[i])])
    along_c = np.column_stack([np.cos(current.directions[j]), np.sin(current.directions[j])])
    target = np.vstack(
        [reference.centres[i] + half_r * along_r, reference.centres[i] - half_r * along_r]
    )
    source = np.vstack(
        [current.centres[j] + half_r * along_c, current.centres[j] - half_r * along_c]
    )
    return motion_of_points(source, target)
