"""Numbers that stand for "no return": one constant value in beam after beam, below range_max.

REP-117 says +inf; many drivers say 29.95, 65.533, 0.0 or the largest number they know. Taken as a
range, such a number is an arc around the lidar that goes wherever the robot goes.

No wall is such an arc. A plane that spans the angle A at distance r comes nearer by r A^2 / 8 in
its middle, so a run of beams that agree to within the lidar's resolution over more than that is a
code by itself, at once. A code in single beams, or one with noise on it, shows after a few scans
from different places: a value is met again and again, in changing beams, and hardly anything lies
just before or behind it, where every surface goes on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_SAME_M = 1e-4
"""What travels as text has four decimals."""
_LEAST_RUN, _QUANTA, _LEAST_HOLLOW_M = 5, 10.0, 0.01
_BAND_M, _BAND_SHARE, _FLANKS, _MOST_FLANK = 0.06, 0.004, 3.0, 0.1
_LEAST_BEAMS, _LEAST_SHARE = 3, 0.01
_COARSE_M = 0.005
_STEP_M = 0.15
_ROOM = 3.0
_SAMPLES, _MEMORY, _SPREADS = 5, 12, 1.5
_MOST_CODES = 4
_TAILS, _ALL = 1.5, 0.95
_FORGOTTEN = 500


@storable("range-code")
@dataclass(frozen=True, slots=True)
class Code:
    """value and tolerance [m]; share of beams that had it, and how many scans ago the last did."""

    value: float
    tolerance: float
    share: float
    ago: int = 0

    def covers(self, ranges: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which ranges say so."""
        with np.errstate(invalid="ignore"):
            said: NDArray[np.bool_] = np.abs(ranges - self.value) <= self.tolerance
        return said


@storable("code-check")
@dataclass
class CodeCheck:
    """Codes that are known; rows value, half width [m] of what may become one; and its beams."""

    known: tuple[Code, ...] = ()
    spikes: list[tuple[float, float]] = field(default_factory=list)
    beams: list[NDArray[np.bool_]] = field(default_factory=list)
    since_m: float = 0.0

    def mask(self, ranges: NDArray[np.float64], increment: float) -> NDArray[np.bool_]:
        """Which ranges are no returns."""
        masked: NDArray[np.bool_] = ranges == 0.0
        for code in self.known:
            masked |= code.covers(ranges)
        left = np.where(masked | ~np.isfinite(ranges), np.nan, ranges)
        for _ in range(_MOST_CODES):
            if (value := _arc(left, increment)) is None:
                break
            arc = Code(value, _SAME_M, 0.0).covers(ranges)
            masked |= arc
            left[arc] = np.nan
        return masked

    def examine(self, sample: Sample) -> None:
        """Learn what the scan at hand calls no return."""
        ranges = sample.scan.ranges
        left = np.where(np.isfinite(ranges), ranges, np.nan)
        self.known = tuple(_aged(code, ranges) for code in self.known if code.ago < _FORGOTTEN)
        for code in self.known:
            left[code.covers(ranges)] = np.nan
        for _ in range(_MOST_CODES):
            if (value := _arc(left, sample.scan.angle_increment)) is None:
                break
            self._learn(Code(value, _SAME_M, float(np.mean(np.abs(left - value) <= _SAME_M))))
            left[self.known[-1].covers(left)] = np.nan
        self._collect(sample, left)

    def _learn(self, code: Code) -> None:
        self.known = (*self.known, code)[-_MOST_CODES:]

    def _collect(self, sample: Sample, left: NDArray[np.float64]) -> None:
        """Once the robot has moved on, look for a value out of all relation.

        Turning does not count: all ranges stay what they are.
        """
        self.since_m += sample.driven_m
        if self.since_m < _STEP_M:
            return
        self.since_m = 0.0
        if self.beams and len(self.beams[0]) != len(left):
            self.spikes, self.beams = [], []
        spike = _spike(left, sample.scan.angle_increment)
        self.spikes = [*self.spikes, spike or (np.nan, 0.0)][-_MEMORY:]
        said = np.zeros(len(left), dtype=np.bool_)
        if spike:
            said = np.abs(left - spike[0]) <= spike[1]
        self.beams = [*self.beams, said][-_MEMORY:]
        if spike:
            self._judge(spike[0])

    def _judge(self, value: float) -> None:
        spikes = np.array(self.spikes)
        # The middle of a few that have noise; else the very number.
        exact = spikes[-1, 1] <= _SAME_M
        slack = _SAME_M if exact else 0.25 * max(_BAND_M, _BAND_SHARE * value)
        same = np.abs(spikes[:, 0] - value) <= slack
        if np.count_nonzero(same) < _SAMPLES:
            return
        said = np.array([b for b, is_same in zip(self.beams, same, strict=True) if is_same])
        # What moves along, a part of the robot, is always in the same beams.
        if np.count_nonzero(said.any(axis=0)) < _SPREADS * np.median(said.sum(axis=1)):
            return
        middle, width = float(np.median(spikes[same, 0])), float(spikes[same, 1].max())
        self._learn(Code(middle, _TAILS * width, float(said.mean())))
        self.spikes, self.beams = [], []

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if not self.known:
            return []
        if sum(code.share for code in self.known if code.ago == 0) > _ALL:
            return [_constant(self.known[-1].value)]
        said = ", ".join(f"{code.value:.4g} m ({100 * code.share:.0f} %)" for code in self.known)
        return [
            Finding(
                "no-return-code",
                "warning",
                f"beams without a return are sent as a constant range, {said}, below range_max: "
                "no surface is equally far in so many directions from wherever the robot stands. "
                "These beams are taken as no return; send inf for them, or set range_max to the "
                "lidar's reach",
            )
        ]


def _constant(value: float) -> Finding:
    return Finding(
        "constant",
        "warning",
        f"every beam says {value:.4g} m: the lidar measures nothing, it is broken or its driver "
        "fills in a number; nothing is made of these scans",
    )


def _aged(code: Code, ranges: NDArray[np.float64]) -> Code:
    share = float(np.mean(code.covers(ranges)))
    if share == 0.0:
        return replace(code, ago=code.ago + 1)
    return replace(code, share=0.9 * code.share + 0.1 * share, ago=0)


def _arc(ranges: NDArray[np.float64], increment: float) -> float | None:
    """The greatest range, where it is that of a run of beams which no plane can be."""
    same = np.abs(np.diff(ranges)) <= _SAME_M
    if np.count_nonzero(same) < _LEAST_RUN - 1:
        return None
    farthest = float(np.nanmax(ranges))
    at = np.concatenate([[False], np.abs(ranges - farthest) <= _SAME_M, [False]])
    edges = np.flatnonzero(at[1:] != at[:-1])
    run = int((edges[1::2] - edges[::2]).max())
    if run < _LEAST_RUN:
        return None
    quantum = _quantum(np.sort(ranges[np.isfinite(ranges)]))
    hollow = farthest * (run * increment) ** 2 / 8.0
    return farthest if hollow > max(_QUANTA * quantum, _LEAST_HOLLOW_M) else None


def _spike(ranges: NDArray[np.float64], increment: float) -> tuple[float, float] | None:
    """Middle and half width of a band with hardly anything before and behind, if there is one.

    The farthest of all, or else a single number: seen through a doorway, the next wall may look so,
    but nobody hits on one number by measuring. Nor does one wall look so over a wide angle.
    """
    values = np.sort(ranges[np.isfinite(ranges)])
    if len(values) == 0:
        return None
    least = max(_LEAST_BEAMS, _LEAST_SHARE * len(ranges))
    band = max(_BAND_M, _BAND_SHARE * float(values[-1]))
    top = values[np.searchsorted(values, values[-1] - band) :]
    found = float(np.median(top)), float(0.5 * (top[-1] - top[0]) + _SAME_M)
    if len(top) < least or not _is_alone(values, top[0], top[-1], band):
        edges = np.flatnonzero(np.concatenate([[True], np.diff(values) > _SAME_M, [True]]))
        counts = np.diff(edges)
        best = int(np.argmax(counts))
        found, quantum = (float(values[edges[best]]), _SAME_M), _quantum(values)
        alone = _is_alone(values, found[0], found[0], 2.0 * quantum)
        if counts[best] < least or quantum > _COARSE_M or not alone:
            return None
    said = np.flatnonzero(np.abs(ranges - found[0]) <= found[1])
    apart = np.diff(said, append=said[0] + max(len(ranges), round(math.tau / abs(increment))))
    extent = math.tau - float(apart.max()) * abs(increment)
    return found if found[0] * extent**2 / 8.0 > _ROOM * band else None


def _is_alone(values: NDArray[np.float64], low: float, high: float, band: float) -> bool:
    """Whether hardly any of the sorted values lie just outside of low to high."""
    flank = _FLANKS * band
    edges = np.array([low - flank, low, high + _SAME_M, high + flank])
    a, b, c, d = np.searchsorted(values, edges)
    return bool((b - a) + (d - c) <= _MOST_FLANK * (c - b))


def _quantum(values: NDArray[np.float64]) -> float:
    """The step in which sorted values come [m]."""
    steps = np.diff(values)
    steps = steps[steps > _SAME_M]
    return max(float(steps.min()), _SAME_M) if len(steps) else _SAME_M
