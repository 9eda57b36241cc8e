"""Walls that come out bent: a wrong angle increment, or turning during the sweep.

If beams lie k times as far apart as is claimed (k = 1 - epsilon or so), a straight wall at distance
d is drawn through points that are off towards the lidar by epsilon * d * alpha * tan(alpha), alpha
being the claimed bearing from the wall's foot point. That holds for all walls with the same sign
and epsilon; real curves (columns, round halls) do not share one. A robot that turns at omega
during a sweep of rate Omega does the same to a scan, with epsilon = -omega / Omega: a wrong
increment is what remains without turning, skew what grows with it.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.features import ScanFeatures
from lineloom_core.features._circle_kernels import ARC, RADIUS, SENSE
from lineloom_core.health import _kernels as kernels
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_LEAST_LENGTH_M = 0.5
_LEAST_POINTS = 10
_LEAST_DISTANCE_M = 0.3
_STEEPEST_RAD = math.radians(75.0)
_LEAST_LEVERAGE_M2, _MOST_LEVERAGE_M2 = 0.02, 2.0
_STEP_M, _STEP_RAD = 0.2, math.radians(6.0)
_MEMORY = 400
_LEAST_SCANS = 40.0
_LEAST_TURNING, _LIKE_ONCE = 8.0, 0.35  # scans while turning, and how near to one turn a scan
_STILL, _TURNING = 0.15, 0.35
_LEAST_EPSILON = 0.03
_LEAST_SKEW_S = 0.02
_SIGNIFICANT = 5.0
_LINEAR = 0.25
_MOST_SPREAD = 0.5
_LEAST_ROUND_M, _LEAST_ROUND_ARC, _ROUND_SHARE, _ROUND_SPREAD = 1.0, 0.5, 0.3, 0.05


@storable("bending-check")
@dataclass
class BendingCheck:
    """The last scans: rows epsilon, leverage [m^2], turn rate [rad/s]; radii of round walls [m].

    sweep_s_per_rad: what a lidar that nobody times was found to take for its sweeps, counted
    counter-clockwise; 0 where it was not.
    """

    bends: deque[tuple[float, float, float]] = field(default_factory=lambda: deque(maxlen=_MEMORY))
    rounds: deque[float] = field(default_factory=lambda: deque(maxlen=_MEMORY))
    since_m: float = 0.0
    since_rad: float = 0.0
    increment: float = 0.0
    is_timed: bool = False
    sweep_s_per_rad: float = 0.0

    def examine(self, sample: Sample) -> None:
        """Measure the next scan once the robot has moved on."""
        self.since_m += sample.moved_m
        self.since_rad += abs(sample.turned_rad)
        rate = sample.turn_rate
        if rate is None or (self.since_m < _STEP_M and self.since_rad < _STEP_RAD):
            return
        self.since_m = self.since_rad = 0.0
        self.increment = sample.scan.angle_increment
        self.is_timed = sample.scan.time_increment > 0.0
        self.rounds.append(_round_wall(sample.features))
        bend = bend_of(sample.features)
        if bend is not None:
            self.bends.append((*bend, rate))

    def time_the_beams(self, usual_s: float) -> None:
        """Time the beams of a lidar that turns once from scan to scan, if walls bend as they would.

        usual_s: from scan to scan [s]. Of what else bends walls nothing depends on the turn rate.
        """
        if self.is_timed or self.sweep_s_per_rad or usual_s <= 0.0 or self._is_round():
            return
        rows = np.array(self.bends).reshape(-1, 3)
        weights = np.minimum(rows[:, 1], _MOST_LEVERAGE_M2)
        still = np.abs(rows[:, 2]) < _STILL
        epsilon = _robust(rows[still, 0], weights[still])
        if epsilon.scans < _LEAST_TURNING:
            return
        once, both = usual_s / math.tau, []
        for turning in (rows[:, 2] < -_TURNING, rows[:, 2] > _TURNING):
            rates = rows[turning, 2]
            both.append(
                _robust((rows[turning, 0] - epsilon.value) / rates, weights[turning] * rates**2)
            )
        sign = math.copysign(1.0, both[0].value)
        if all(
            abs(sign * way.value - once) < _LIKE_ONCE * once
            and way.scans >= 0.5 * _LEAST_TURNING
            and way.stands_out(0.0)
            for way in both
        ):
            self.sweep_s_per_rad = -sign * once

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if self.sweep_s_per_rad and not self.is_timed:
            return [
                _skew(abs(self.sweep_s_per_rad), self.increment, "it is corrected by that; better ")
            ]
        rows = np.array(self.bends).reshape(-1, 3)
        weights = np.minimum(rows[:, 1], _MOST_LEVERAGE_M2)
        still = np.abs(rows[:, 2]) < _STILL
        epsilon = _robust(rows[still, 0], weights[still])
        if epsilon.scans < _LEAST_SCANS or self._is_round():
            return []
        found = []
        if epsilon.stands_out(_LEAST_EPSILON):
            found.append(_wrong_increment(epsilon.value, self.increment))
        turning = np.abs(rows[:, 2]) > _TURNING
        rates = rows[turning, 2]
        skew = _robust((rows[turning, 0] - epsilon.value) / rates, weights[turning] * rates**2)
        if not self.is_timed and skew.scans >= _LEAST_SCANS and skew.stands_out(_LEAST_SKEW_S):
            found.append(_skew(abs(skew.value), self.increment))
        return found

    def _is_round(self) -> bool:
        """Whether the walls are round indeed: such a wall has the same radius from everywhere."""
        radii = np.array([radius for radius in self.rounds if radius > 0.0])
        if len(radii) < _ROUND_SHARE * len(self.rounds) or len(radii) == 0:
            return False
        middle = float(np.median(radii))
        return float(np.median(np.abs(radii - middle))) < _ROUND_SPREAD * middle


@dataclass(frozen=True, slots=True)
class _Robust:
    """A weighted median, its spread (as a standard deviation) and for how many scans it speaks."""

    value: float
    spread: float
    scans: float

    def stands_out(self, least: float) -> bool:
        """Whether the value is large, beyond chance, and much the same from scan to scan."""
        error = 1.25 * self.spread / math.sqrt(self.scans)
        size = abs(self.value)
        return (
            size > max(least, _SIGNIFICANT * error)
            and self.spread < _MOST_SPREAD * size + 0.5 * least
        )


def _robust(values: NDArray[np.float64], weights: NDArray[np.float64]) -> _Robust:
    if len(values) == 0:
        return _Robust(0.0, math.inf, 0.0)
    middle = _weighted_median(values, weights)
    spread = 1.4826 * _weighted_median(np.abs(values - middle), weights)
    return _Robust(middle, spread, float(weights.sum() ** 2 / np.sum(weights**2)))


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(below, 0.5 * below[-1])])


def _round_wall(features: ScanFeatures) -> float:
    """Radius [m] of the longest arc seen from inside; 0 where there is none."""
    circles = features.circles
    is_room = (circles[:, SENSE] < 0) & (circles[:, ARC] > _LEAST_ROUND_ARC)
    inside = circles[is_room & (circles[:, RADIUS] > _LEAST_ROUND_M)]
    return float(inside[np.argmax(inside[:, ARC]), RADIUS]) if len(inside) else 0.0


def bend_of(features: ScanFeatures) -> tuple[float, float] | None:
    """Return epsilon of a scan, by how much its increment is too large, and its leverage [m^2].

    The variance of epsilon is that of the points across the walls over the leverage. None where no
    wall is seen long and wide enough to tell.
    """
    above, below = wall_bends(features).sum(axis=0).tolist()
    return (above / below, below) if below >= _LEAST_LEVERAGE_M2 else None


def wall_bends(features: ScanFeatures) -> NDArray[np.float64]:
    """How each long wall is bent, shape (n, 2): epsilon times leverage, leverage [m^2]."""
    bends: NDArray[np.float64] = kernels.bulges(
        features.points, features.beams, features.lines,
        _LEAST_LENGTH_M, _LEAST_POINTS, _LEAST_DISTANCE_M, _STEEPEST_RAD,
    )  # fmt: skip
    return bends


def _wrong_increment(epsilon: float, increment: float) -> Finding:
    way = "large" if epsilon > 0.0 else "small"
    if abs(epsilon) <= _LINEAR:
        by = f"about {100 * abs(epsilon):.0f} % too {way}; it should be near "
        by += f"{increment / (1.0 + epsilon):.5f} rad"
    else:
        by = f"far too {way}, by a quarter or more"
    return Finding(
        "angle-increment",
        "error",
        f"straight walls come out bent: angle_increment {increment:.5f} rad is {by}, or the count "
        "of ranges is not what the driver thinks",
    )


def _skew(seconds_per_rad: float, increment: float, done: str = "") -> Finding:
    return Finding(
        "skew",
        "warning",
        f"scans are bent while the robot turns: a sweep takes {seconds_per_rad * math.tau:.2f} s "
        f"per turn and the robot turns meanwhile; {done}send time_increment (about "
        f"{1e6 * seconds_per_rad * abs(increment):.0f} microseconds)"
        + ("" if done else " and it is corrected"),
    )
