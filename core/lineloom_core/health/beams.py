"""Beams that always see the same, wherever the robot goes: its own parts, or nothing at all.

Over a stretch in which the robot drove and turned enough for every beam to have looked at
different things, each beam's returns are counted. What stays within a few centimetres at arm's
length is carried along; what is never valid is blocked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_LEAST_SAMPLES = 40
_LEAST_WAY_M = 6.0
_LEAST_TURN_RAD = 2.5
_STEP_M, _STEP_RAD = 0.15, math.radians(8.0)
_ARM_M = 0.8
_SPREAD_M = 0.1
_HIT_SHARE, _BLOCKED_SHARE = 0.9, 0.98
_LEAST_HIT_BEAMS = 2
_LEAST_BLOCKED_RAD = math.radians(4.0)


@storable("beam-stretch")
@dataclass
class _Stretch:
    """Counts over one stretch of way, per beam; n beams."""

    angle_min: float
    angle_increment: float
    nearest: NDArray[np.float32]
    farthest: NDArray[np.float32]
    near: NDArray[np.int16]
    invalid: NDArray[np.int16]
    samples: int = 0
    way_m: float = 0.0
    turn_rad: float = 0.0

    @staticmethod
    def begin(sample: Sample) -> _Stretch:
        n = len(sample.scan)
        return _Stretch(
            sample.scan.angle_min,
            sample.scan.angle_increment,
            np.full(n, np.inf, dtype=np.float32),
            np.zeros(n, dtype=np.float32),
            np.zeros(n, dtype=np.int16),
            np.zeros(n, dtype=np.int16),
        )

    def fits(self, sample: Sample) -> bool:
        """Whether the scan has the beams that are being counted."""
        return (
            len(sample.scan) == len(self.near)
            and abs(sample.scan.angle_min - self.angle_min) < 1e-3
            and abs(sample.scan.angle_increment / self.angle_increment - 1.0) < 0.1
        )

    def add(self, ranges: NDArray[np.float64]) -> None:
        with np.errstate(invalid="ignore"):
            near = (ranges > 0.0) & (ranges < _ARM_M)
        hits = ranges[near].astype(np.float32)
        self.nearest[near] = np.minimum(self.nearest[near], hits)
        self.farthest[near] = np.maximum(self.farthest[near], hits)
        self.near += near
        self.invalid += np.isnan(ranges) | (ranges <= 0.0)
        self.samples += 1

    @property
    def is_long(self) -> bool:
        return (
            self.samples >= _LEAST_SAMPLES
            and self.way_m >= _LEAST_WAY_M
            and self.turn_rad >= _LEAST_TURN_RAD
        )


@storable("beam-check")
@dataclass
class BeamCheck:
    """Judges stretch after stretch; what was found holds until the next one is judged."""

    stretch: _Stretch | None = None
    since_m: float = 0.0
    since_rad: float = 0.0
    own: NDArray[np.bool_] | None = None
    """Beams that see the robot itself; None before the first stretch."""
    found: tuple[Finding, ...] = ()

    def examine(self, sample: Sample) -> None:
        """Count the next scan once the robot has moved on."""
        if self.stretch is None or not self.stretch.fits(sample):
            self.stretch, self.own, self.found = _Stretch.begin(sample), None, ()
        if sample.step is None:
            return
        self.stretch.way_m += sample.moved_m
        self.stretch.turn_rad += abs(sample.turned_rad)
        self.since_m += sample.moved_m
        self.since_rad += abs(sample.turned_rad)
        if self.since_m < _STEP_M and self.since_rad < _STEP_RAD:
            return
        self.since_m = self.since_rad = 0.0
        self.stretch.add(sample.scan.ranges)
        if self.stretch.is_long:
            self._judge(self.stretch)
            self.stretch = _Stretch.begin(sample)

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        return list(self.found)

    def _judge(self, stretch: _Stretch) -> None:
        steady = stretch.farthest - stretch.nearest < _SPREAD_M
        own = steady & (stretch.near >= _HIT_SHARE * stretch.samples)
        blocked = stretch.invalid >= _BLOCKED_SHARE * stretch.samples
        runs = _runs(own, _LEAST_HIT_BEAMS)
        least = max(2, math.ceil(_LEAST_BLOCKED_RAD / abs(stretch.angle_increment)))
        self.own = np.zeros(len(own), dtype=np.bool_)
        found = []
        for a, b in runs:
            self.own[a:b] = True
        if runs:
            reach = 0.5 * float((stretch.nearest + stretch.farthest)[self.own].mean())
            found.append(
                Finding(
                    "self-hits",
                    "warning",
                    f"the lidar sees something that moves along with it, {reach:.2f} m away at "
                    f"{_sectors(runs, stretch)}: a part of the robot, it seems; these beams are "
                    "left out. Move the part or the lidar, or cut the beams in the driver",
                )
            )
        gaps = _runs(blocked, least)
        if gaps and not blocked.all():
            found.append(
                Finding(
                    "blocked-sector",
                    "note",
                    f"no valid return ever comes from {_sectors(gaps, stretch)}, wherever the "
                    "robot goes: something sits on the lidar or too near to it; the map gets "
                    "nothing from there",
                )
            )
        self.found = tuple(found)


def _runs(mask: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    """Runs of at least `least` beams, first and one past the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    pairs = [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
    return [(a, b) for a, b in pairs if b - a >= least]


def _sectors(runs: list[tuple[int, int]], stretch: _Stretch) -> str:
    def degrees(beam: int) -> float:
        return math.degrees(stretch.angle_min + beam * stretch.angle_increment)

    shown = [f"{degrees(a):.0f} to {degrees(b - 1):.0f} degrees" for a, b in runs[:4]]
    return ", ".join(shown) + (", ..." if len(runs) > 4 else "")
