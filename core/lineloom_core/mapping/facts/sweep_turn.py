"""How fast a robot turns while its lidar sweeps: from the very scan that is bent by it.

What the last steps say of it comes a scan late: who starts to turn at 2 rad/s under a lidar of
5 Hz sends a scan that is bent by 20 degrees, and is believed to have turned by half of that. So
where rates that may be right differ by more than a bend that matters, the scan is straightened by
each, and the one is taken by which it lies best on what the robot has just seen; then some nearby.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features import ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_core.health import without_skew
from lineloom_core.health.bending import wall_bends
from lineloom_core.mapping.facts.tracker import Tracker
from lineloom_core.matching.local_map import Cloud, LocalMap
from lineloom_core.scan import Scan

_LEAST_BEND = 0.03  # rad at the end of a sweep: less makes no difference
_FINE = 0.065**2  # m^2: what speaks against a rate up to here is no bend
_TRIED = -2.7, -1.8, -0.9, 0.9, 1.8, 2.7  # rad/s
_NEARBY = 0.45, 0.2, 0.1  # rad/s: by which a rate is tried to be bettered, in turn
_FASTEST = 4.0  # rad/s
_POINT_M = 0.015  # m: what points of a wall are off by
_LEAST_WALLS = 2
_ALIKE, _AGREEING = 0.4, 0.6  # shares: of a rate that walls differ by, of what agrees
_REACH = 0.3, 0.6  # m, rad: around what is expected
_GATE = 0.15  # m: what lies farther from all that is known counts as so far
_BETTER = 0.4  # of what speaks against a rate that was expected: what is better is believed


def turn_rate_of_sweep(
    tracker: Tracker | None, scan: Scan, extraction: ExtractionConfig, *, inverted: bool
) -> float:
    """Turn rate [rad/s] during the sweep of a scan as it came, its beams timed.

    Without a track yet only the scan's own walls tell; 0 where they do not.
    """
    if tracker is None:
        straight = scan.counter_clockwise(inverted=inverted)
        bent = _bent_by(scan, extract_features(straight, extraction), inverted=inverted)
        return 0.0 if bent is None else bent
    trial = _Trial(tracker, scan, extraction, inverted=inverted)
    expected = tracker.turn_rate
    known = trial.cost(expected)
    likely = [trial.last, 0.0]
    if known < _FINE and all(trial.bends_alike(expected, rate) for rate in likely):
        return expected
    cost, best = min([(known, expected), *((trial.cost(rate), rate) for rate in likely)])
    if cost > _FINE:
        cost, best = min([(cost, best), *((trial.cost(rate), rate) for rate in trial.rates())])
        for off in _NEARBY:
            nearby = [(trial.cost(rate), rate) for rate in (best - off, best + off)]
            cost, best = min([(cost, best), *nearby])
    return best if cost < _BETTER * known else expected


class _Trial:
    """Straightens a scan by a rate, and sees how it lies on what the robot has just seen."""

    def __init__(
        self, tracker: Tracker, scan: Scan, extraction: ExtractionConfig, *, inverted: bool
    ) -> None:
        self._scan, self._extraction, self._inverted = scan, extraction, inverted
        self._map, self._expected, self.last = tracker.surroundings(scan.stamp)

    def bends_alike(self, rate: float, other: float) -> bool:
        """Whether it makes no difference by which of two rates the scan is straightened."""
        sweep = abs(self._scan.time_increment) * (len(self._scan) - 1)
        return abs(rate - other) * sweep < _LEAST_BEND

    def rates(self) -> list[float]:
        """What it may be, and what the scan's own walls say."""
        features = extract_features(self._straight(0.0), self._extraction)
        bent = _bent_by(self._scan, features, inverted=self._inverted)
        return [*_TRIED, *([] if bent is None else [bent])]

    def cost(self, rate: float) -> float:
        """Mean square of how far the points lie from what is known, up to the gate [m^2]."""
        cloud = Cloud.of(extract_features(self._straight(rate), self._extraction))
        return min(_misfit(self._map, cloud, guess) for guess in self._expected)

    def _straight(self, rate: float) -> Scan:
        still = without_skew(self._scan, rate, inverted=self._inverted)
        return still.counter_clockwise(inverted=self._inverted)


def _bent_by(scan: Scan, features: ScanFeatures, *, inverted: bool) -> float | None:
    """The turn rate that bends most of the walls of a scan as they are; None if none does."""
    bends = wall_bends(features)
    if len(bends) < _LEAST_WALLS:
        return None
    per_rad = scan.angle_increment / scan.time_increment * (1.0 if inverted else -1.0)
    rates, leverage = per_rad * bends[:, 0] / bends[:, 1], bends[:, 1]
    order = np.argsort(rates, kind="stable")
    below = np.cumsum(leverage[order])
    rate = float(rates[order][np.searchsorted(below, 0.5 * below[-1])])
    sigma = _POINT_M * abs(per_rad) / math.sqrt(below[-1])
    agreeing = float(leverage[np.abs(rates - rate) < _ALIKE * abs(rate)].sum() / below[-1])
    clear = 3.0 * sigma < abs(rate) < _FASTEST and agreeing > _AGREEING
    return rate if clear else None


def _misfit(known: LocalMap, cloud: Cloud, guess: Pose) -> float:
    pose, _ = known.search(cloud, guess, reach_xy=_REACH[0], reach_theta=_REACH[1])
    found = known.register(cloud, pose, gate=_GATE)
    total = max(found.total, 1e-9)
    return ((total - found.matched) * _GATE**2 + found.matched * found.rms**2) / total
