"""Where in a plan a map might lie: every place there is, by correlation; nothing is guessed.

1. Rotations: the histograms of wall directions, weighted by length, laid over each other at every
   angle (circular over a half turn: plans have no free side, so every turn comes in two).
2. Translations: for each rotation, map and plan as pictures of their walls, a picture per
   direction, correlated at every shift by FFT; the peaks are the hypotheses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

from lineloom_core.floorplan.samples import Samples
from lineloom_core.geometry import Pose

_BINS = 720
_SMOOTHING_BINS = 2.0
_MOST_TURNS = 6
_LEAST_TURN = 0.5

_CHANNELS = 6
_CELL_M = 0.25
_MOST_CELLS = 2048
_BLUR_CELLS = 1.0
_PEAK_APART_M = 1.0
_PEAKS_PER_TURN = 12


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """T_plan_map, and how much wall lies on wall there (a figure to rank by, no measure)."""

    T_plan_map: Pose
    overlap: float


def hypotheses(plan: Samples, site: Samples) -> list[Hypothesis]:
    """Return where the map's lines might lie in the plan, the best overlap first."""
    found: list[Hypothesis] = []
    field = _PlanField.of(plan, site)
    for turn in _turns(plan, site):
        for theta in (turn, turn + math.pi):
            found += field.translations(site, theta)
    return sorted(found, key=lambda h: -h.overlap)


def _turns(plan: Samples, site: Samples) -> list[float]:
    """Return the rotations, modulo a half turn, at which the directions fit."""
    score = fft.irfft(fft.rfft(_histogram(plan)) * np.conj(fft.rfft(_histogram(site))), n=_BINS)
    peaks = (score >= np.roll(score, 1)) & (score > np.roll(score, -1))
    order = [i for i in np.argsort(-score, kind="stable").tolist() if peaks[i]]
    kept = [i for i in order[:_MOST_TURNS] if score[i] >= _LEAST_TURN * score[order[0]]]
    return [_between_bins(score, i) * math.pi / _BINS for i in kept]


def _histogram(samples: Samples) -> NDArray[np.float64]:
    bins = np.floor((samples.direction % math.pi) * (_BINS / math.pi)).astype(np.int64) % _BINS
    heights = np.bincount(bins, samples.weight, _BINS)
    smooth: NDArray[np.float64] = ndimage.gaussian_filter1d(heights, _SMOOTHING_BINS, mode="wrap")
    return smooth


def _between_bins(score: NDArray[np.float64], i: int) -> float:
    """Return the top of the parabola through a peak and its neighbours."""
    left, top, right = score[i - 1], score[i], score[(i + 1) % len(score)]
    bend = left - 2.0 * top + right
    return i + (0.5 * (left - right) / bend if bend < 0.0 else 0.0)


@dataclass(frozen=True, eq=False)
class _PlanField:
    """The plan's pictures, transformed; with room beside the plan, so that a map that hangs over
    one edge does not come in at the other. corner: of the plan's lowest cell [m]. size: columns
    and rows that the plan itself takes."""

    transforms: NDArray[np.complex64]
    shape: tuple[int, int]
    size: tuple[int, int]
    corner: NDArray[np.float64]
    cell: float

    @staticmethod
    def of(plan: Samples, site: Samples) -> _PlanField:
        reach = np.hypot(*(np.ptp(site.points, axis=0)))
        span = np.ptp(plan.points, axis=0) + reach + 8 * _CELL_M
        cell = max(_CELL_M, float(span.max()) / _MOST_CELLS)
        shape = tuple(int(fft.next_fast_len(math.ceil(s / cell), real=True)) for s in span[::-1])
        assert len(shape) == 2
        corner = plan.points.min(axis=0) - 2 * cell
        columns, rows = np.ceil(np.ptp(plan.points, axis=0) / cell).astype(int).tolist()
        pictures = _pictures(plan.points - corner, plan.direction, plan.weight, shape, cell)
        for picture in pictures:
            # A wall drawn twice, or hatched, is one wall.
            np.minimum(picture, cell, out=picture)
        blurred = ndimage.gaussian_filter(pictures, (0.0, _BLUR_CELLS, _BLUR_CELLS), mode="wrap")
        return _PlanField(fft.rfft2(blurred), shape, (columns + 4, rows + 4), corner, cell)

    def translations(self, site: Samples, theta: float) -> list[Hypothesis]:
        """Return the best shifts of the map turned by theta."""
        turned = Pose(0.0, 0.0, theta).transform(site.points)
        low = turned.min(axis=0)
        pictures = _pictures(
            turned - low, site.direction + theta, site.weight, self.shape, self.cell
        )
        product = (self.transforms * np.conj(fft.rfft2(pictures))).sum(axis=0)
        score = fft.irfft2(product, s=self.shape)
        return [
            Hypothesis(self._pose(i, j, low, theta), float(score[i, j]))
            for i, j in self._peaks(score)
        ]

    def _peaks(self, score: NDArray[np.float32]) -> list[tuple[int, int]]:
        around = 2 * max(1, round(_PEAK_APART_M / self.cell)) + 1
        tops = np.argwhere(score == ndimage.maximum_filter(score, around, mode="wrap"))
        order = np.argsort(-score[tops[:, 0], tops[:, 1]], kind="stable")[:_PEAKS_PER_TURN]
        return [(int(i), int(j)) for i, j in tops[order]]

    def _pose(self, i: int, j: int, low: NDArray[np.float64], theta: float) -> Pose:
        """Return the pose of a shift; one beyond the plan is a shift back, around the torus."""
        rows, columns = self.shape
        right, up = self.size
        shift = np.array([j - columns if j > right else j, i - rows if i > up else i])
        x, y = (self.corner + shift * self.cell - low).tolist()
        return Pose(x, y, theta)


def _pictures(
    points: NDArray[np.float64],
    direction: NDArray[np.float64],
    weight: NDArray[np.float64],
    shape: tuple[int, int],
    cell: float,
) -> NDArray[np.float32]:
    """Draw samples into a picture per direction; a direction between two goes into both."""
    pictures = np.zeros((_CHANNELS, *shape), dtype=np.float32)
    column = np.floor(points[:, 0] / cell).astype(np.int64) % shape[1]
    row = np.floor(points[:, 1] / cell).astype(np.int64) % shape[0]
    exact = (direction % math.pi) * (_CHANNELS / math.pi)
    first = np.floor(exact).astype(np.int64)
    share = exact - first
    np.add.at(pictures, (first % _CHANNELS, row, column), weight * (1.0 - share))
    np.add.at(pictures, ((first + 1) % _CHANNELS, row, column), weight * share)
    return pictures
