"""Angle, x and y histograms: thesis §2.1.2, [28].

[28] G. Weiss, C. Wetzler and E. von Puttkamer, "Keeping track of position and orientation of moving
indoor systems by correlation of range-finder scans", IROS 1994. The histogram of directions between
neighbouring points does not change with position and shifts with rotation: its cross-correlation
gives the rotation. Both scans are then turned so that walls run along the axes, and histograms of
x and y, correlated one by one, give the translation.

Needs no guess, but walls at right angles and much in common.

Departures: directions are taken over chords of at least `chord` metres and weighted with their
length, for between neighbouring beams noise turns them at will; the paper takes the highest peak
near the odometry's rotation, we take the `peaks` highest of the full turn and the one whose x and y
histograms agree best.
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

_MOST_BEAMS = 60


@dataclass(frozen=True, slots=True)
class AngleHistogramConfig:
    """Parameters; metres, radians, shares 0..1.

    bins: of the full turn. chord: least distance of the points a direction is taken between.
    least_chords: directions without which a scan has no histogram. smoothing: half width of the
    triangle that histograms are smoothed with, in bins. peaks: rotations tried. cell: width of the
    x and y bins. extent: half width of the x and y histograms. reach: greatest translation along
    each axis. least_score: from which on the verdict is "match".
    """

    bins: int = 360
    chord: float = 0.2
    least_chords: int = 5
    smoothing: int = 2
    peaks: int = 4
    cell: float = 0.05
    extent: float = 26.0
    reach: float = 4.0
    least_score: float = 0.7
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)


@dataclass(frozen=True, eq=False)
class AngleScan:
    """points (n, 2) [m] with weights (n,), their share of wall; histogram (bins,) of directions,
    smoothed, of unit norm (zero where a scan has too few chords).
    """

    points: Array
    weights: Array
    histogram: Array


class AngleHistogramMatcher:
    """Weiss's three correlations."""

    def __init__(self, config: AngleHistogramConfig | None = None) -> None:
        self.config = config or AngleHistogramConfig()

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "angle-histogram"

    def prepare(self, scan: Scan) -> AngleScan:
        """Take points and the histogram of directions."""
        features = extract_features(scan, self.config.extraction)
        starts, ends = _chords(features, self.config.chord)
        along = features.points[ends] - features.points[starts]
        bins = self.config.bins
        which = np.floor((np.arctan2(along[:, 1], along[:, 0]) / math.tau % 1.0) * bins).astype(int)
        lengths = np.minimum(np.linalg.norm(along, axis=1), 2.0 * self.config.chord)
        sums = np.bincount(which % bins, weights=lengths, minlength=bins)
        counts = np.asarray(sums, dtype=np.float64)
        if len(starts) < self.config.least_chords:
            counts = np.zeros(bins)
        ranges = np.linalg.norm(features.points, axis=1)
        weights = np.minimum(ranges * features.angle_increment, self.config.cell)
        return AngleScan(features.points, weights, _unit(self._smooth(counts)))

    def match_prepared(self, reference: AngleScan, current: AngleScan) -> MatchResult:
        """Find T_reference_current."""
        if not reference.histogram.any() or not current.histogram.any():
            return nothing(f"fewer than {self.config.least_chords} directions in a scan")
        spectrum = np.fft.rfft(reference.histogram) * np.conj(np.fft.rfft(current.histogram))
        agreement = np.fft.irfft(spectrum, n=self.config.bins)
        best: tuple[float, Pose, dict[str, float]] | None = None
        for peak in _peaks(agreement, self.config.peaks):
            theta = _between_bins(agreement, peak) * math.tau / self.config.bins
            shift, along, across = self._translation(reference, current, theta)
            score = float(agreement[peak]) * along * across
            if best is None or score > best[0]:
                pose = Pose(float(shift[0]), float(shift[1]), math.remainder(theta, math.tau))
                checks = {"angles": float(agreement[peak]), "x": along, "y": across}
                best = score, pose, checks
        if best is None:
            return nothing("the histograms of directions have nothing in common")
        score, pose, checks = best
        return hypothesis(pose, max(score, 0.0), self.config.least_score, checks=checks)

    def _translation(
        self, reference: AngleScan, current: AngleScan, theta: float
    ) -> tuple[Array, float, float]:
        """Correlate x and y with walls along the axes; translation (2,) and both agreements."""
        main = float(np.argmax(reference.histogram) + 0.5) * math.tau / self.config.bins
        level = Pose(0.0, 0.0, -main)
        a = level.transform(reference.points)
        b = Pose(0.0, 0.0, theta - main).transform(current.points)
        found = [
            self._shift(a[:, axis], reference.weights, b[:, axis], current.weights)
            for axis in (0, 1)
        ]
        shift = level.inverse().transform(np.array([found[0][0], found[1][0]]))
        return shift, found[0][1], found[1][1]

    def _shift(self, a: Array, a_weights: Array, b: Array, b_weights: Array) -> tuple[float, float]:
        """Shift of b onto a along one axis [m] by correlation, and the agreement there, 0..1."""
        edges = np.arange(
            -self.config.extent, self.config.extent + self.config.cell, self.config.cell
        )
        one = _unit(self._smooth(np.histogram(a, edges, weights=a_weights)[0]))
        other = _unit(self._smooth(np.histogram(b, edges, weights=b_weights)[0]))
        size = 2 * len(one)
        spectrum = np.fft.rfft(one, size) * np.conj(np.fft.rfft(other, size))
        agreement = np.fft.irfft(spectrum, n=size)
        most = round(self.config.reach / self.config.cell)
        allowed = np.concatenate([np.arange(most + 1), np.arange(size - most, size)])
        best = int(allowed[np.argmax(agreement[allowed])])
        place = _between_bins(agreement, best)
        cells = place - size if place > size / 2 else place
        return cells * self.config.cell, min(max(float(agreement[best]), 0.0), 1.0)

    def _smooth(self, counts: Array) -> Array:
        """Smooth a histogram with a triangle, cyclically."""
        half = self.config.smoothing
        smoothed = np.zeros_like(counts, dtype=np.float64)
        for k in range(-half, half + 1):
            smoothed += (half + 1 - abs(k)) * np.roll(counts, k)
        return smoothed


def _chords(features: ScanFeatures, least: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last points of chords: from each point to the next one `least` metres on.

    Never from one surface to another, and never over more than `_MOST_BEAMS` points.
    """
    points, count = features.points, len(features.points)
    surface: NDArray[np.int64] = np.cumsum(features.breaks) - features.breaks
    ends = np.full(count, -1, dtype=np.int64)
    for step in range(1, min(_MOST_BEAMS, count)):
        far = np.linalg.norm(points[step:] - points[:-step], axis=1) >= least
        first = far & (surface[step:] == surface[:-step]) & (ends[:-step] < 0)
        ends[:-step][first] = np.flatnonzero(first) + step
    starts = np.flatnonzero(ends >= 0)
    return starts, ends[starts]


def _unit(histogram: Array) -> Array:
    norm = float(np.linalg.norm(histogram))
    return histogram / norm if norm > 0.0 else histogram


def _peaks(values: Array, most: int) -> list[int]:
    """Greatest local maxima of a cyclic curve, best first, ties by place."""
    higher = (values >= np.roll(values, 1)) & (values > np.roll(values, -1)) & (values > 0.0)
    places = np.flatnonzero(higher)
    return [int(k) for k in places[np.argsort(-values[places], kind="stable")][:most]]


def _between_bins(values: Array, k: int) -> float:
    """Place of a cyclic curve's peak by the parabola through bin k and its neighbours."""
    before, at, after = values[k - 1], values[k], values[(k + 1) % len(values)]
    bend = before - 2.0 * at + after
    return k + (0.5 * float((before - after) / bend) if bend < 0.0 else 0.0)
