"""What rides along: the floor before a tilted lidar, and the robot's own parts, at any distance.

A beam that has the same range from two places may look along a wall. It may not, where from the
second place others look through the very spot: then nothing stood there, and what the beam saw
came along. Some such votes for a beam, all at one range beyond which it never sees, and it is held
to end there. The floor is cut by a lidar's plane in a straight line: where what rides along lies on
one, all beams that reach the line are cut off there, those too that have not been seen to.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample
from lineloom_core.scan import Scan

_STEP_M, _STEP_RAD = 0.25, math.radians(10.0)
_NOISE_M, _NOISE_SHARE = 0.03, 0.015
_THROUGH = 3.0
_VOTES, _MOST_VOTES, _STEADY = 4.0, 12.0, 8
_LEAST_RUN = 3
_LEAST_LINE_M, _LEAST_LINE_BEAMS, _MOST_LINE_SHARE = 0.4, 4, 0.01
_LINES, _AGREEING, _ALIKE_SHARE, _ALIKE_RAD = 24, 4, 0.06, math.radians(6.0)
_STEEPEST, _MOST_BEYOND = 0.4, 0.15


@storable("riding-beams")
@dataclass
class _Beams:
    """Of n beams: the range that came along [m], votes for it, how often in a row each had the
    range that it had before; the scan that was looked at last, and T_before_this since.
    """

    angle_min: float
    before: NDArray[np.float64]
    level: NDArray[np.float64]
    votes: NDArray[np.float64]
    steady: NDArray[np.int64]
    way: Pose = field(default_factory=Pose.identity)

    @staticmethod
    def begin(sample: Sample) -> _Beams:
        n = len(sample.scan)
        none = np.zeros(n), np.zeros(n), np.zeros(n, dtype=np.int64)
        return _Beams(sample.scan.angle_min, sample.scan.ranges, *none)

    def fits(self, sample: Sample) -> bool:
        same = len(self.level) == len(sample.scan)
        return same and abs(sample.scan.angle_min - self.angle_min) < 1e-3

    def look_from(self, ranges: NDArray[np.float64]) -> None:
        """Hold the scans that follow against this one."""
        self.before, self.way = ranges, Pose.identity()


@storable("riding-check")
@dataclass
class RidingCheck:
    """cut: from where on each beam sees what rides along [m], inf where nothing does.

    line: distance [m] and direction [rad] of the straight line on which that lies; lines: of single
    scans.
    """

    beams: _Beams | None = None
    cut: NDArray[np.float64] | None = None
    line: tuple[float, float] | None = None
    lines: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_LINES))

    def mask(self, ranges: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which ranges end at what rides along."""
        if self.cut is None or len(self.cut) != len(ranges):
            return np.zeros(len(ranges), dtype=np.bool_)
        with np.errstate(invalid="ignore"):
            beyond: NDArray[np.bool_] = np.isfinite(ranges) & (ranges > self.cut)
        return beyond

    def examine(self, sample: Sample) -> None:
        """Hold the next scan against the last one that was looked at, once the robot moved on."""
        beams = self.beams
        if beams is None or not beams.fits(sample):
            self.beams, self.cut, self.line = _Beams.begin(sample), None, None
            self.lines.clear()
            return
        if sample.step is None:
            beams.look_from(sample.scan.ranges)
            return
        beams.way = beams.way @ sample.step
        if math.hypot(beams.way.x, beams.way.y) < _STEP_M and abs(beams.way.theta) < _STEP_RAD:
            return
        self._find_line(sample, _vote(beams, sample.scan))
        self._conclude(beams, sample.scan)
        beams.look_from(sample.scan.ranges)

    def _find_line(self, sample: Sample, came: NDArray[np.bool_]) -> None:
        """A floor is seen again and again in one straight line, and nothing behind it."""
        ranges, angles = sample.scan.ranges, sample.scan.angles
        runs = _runs(came, _LEAST_LINE_BEAMS)
        if runs:
            a, b = max(runs, key=lambda run: run[1] - run[0])
            found = _line(ranges[a:b], angles[a:b])
            if found is not None:
                self.lines.append(found)
                alike = [line for line in self.lines if _are_alike(line, found)]
                if len(alike) >= _AGREEING:
                    far, way = np.median(np.array(alike), axis=0)
                    self.line = float(far), float(way)
        if self.line is not None and _is_overlooked(self.line, ranges, angles):
            self.line = None
            self.lines.clear()

    def _conclude(self, beams: _Beams, scan: Scan) -> None:
        if self.line is not None:
            floor = _floor(self.line, scan.angles)
            self.cut = (1.0 - _THROUGH * _NOISE_SHARE) * floor - _THROUGH * _NOISE_M
            return
        held = np.zeros(len(scan), dtype=np.bool_)
        for a, b in _runs(beams.votes >= _VOTES, _LEAST_RUN):
            held[a:b] = True
        _grow(held, beams, scan)
        slack = _THROUGH * (_NOISE_M + _NOISE_SHARE * beams.level)
        self.cut = np.where(held, beams.level - slack, np.inf) if held.any() else None

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if self.cut is None or self.beams is None:
            return []
        held = np.isfinite(self.cut)
        if self.line is not None:
            distance, direction = self.line
            return [
                Finding(
                    "tilted",
                    "warning",
                    f"something straight moves along with the robot, {distance:.1f} m away at "
                    f"{math.degrees(direction):.0f} degrees: the floor or the ceiling, it seems, "
                    "which a tilted lidar sees, or else a part of the robot or a trailer; what "
                    "lies there is left out. Level the lidar",
                )
            ]
        reach = float(np.median(self.beams.level[held]))
        return [
            Finding(
                "rides-along",
                "warning",
                f"{np.count_nonzero(held)} beams see something that moves along with the robot, "
                f"{reach:.1f} m away: a part of it, a trailer, or the floor before a tilted "
                "lidar; what lies there is left out. Level the lidar, or cut the beams in the "
                "driver",
            )
        ]


def _vote(beams: _Beams, scan: Scan) -> NDArray[np.bool_]:
    """Count for each beam whether what it sees came along; which did."""
    now = scan.ranges
    with np.errstate(invalid="ignore"):
        slack = _NOISE_M + _NOISE_SHARE * now
        stayed = np.abs(now - beams.before) < slack
        came = stayed & _seen_through(beams, scan)
        same = np.abs(now - beams.level) < 2.0 * slack
        beyond = (now > beams.level + _THROUGH * slack) & np.isfinite(now)
    beams.steady = np.where(stayed, beams.steady + 1, 0)
    first = came & (beams.votes < 1.0)
    more = came & same & ~first
    beams.level[first], beams.votes[first] = now[first], 1.0
    beams.level[more] += (now[more] - beams.level[more]) / (1.0 + beams.votes[more])
    beams.votes[more] = np.minimum(beams.votes[more] + 1.0, _MOST_VOTES)
    beams.votes[beyond & ~first] *= 0.5
    return came


def _seen_through(beams: _Beams, scan: Scan) -> NDArray[np.bool_]:
    """Which spots of the scan before others see through now."""
    now, n, angles = scan.ranges, len(scan), scan.angles
    with np.errstate(invalid="ignore"):
        x = beams.before * np.cos(angles) - beams.way.x
        y = beams.before * np.sin(angles) - beams.way.y
        bearing = np.arctan2(y, x) - beams.way.theta - scan.angle_min
        at = np.mod(bearing, math.tau) / scan.angle_increment
        beam = np.rint(np.where(np.isfinite(at), at, -1.0)).astype(np.int64)
        known = (beam >= 0) & (beam < n)
        beam = np.clip(beam, min(1, n - 1), max(n - 2, 0))
        here = np.where(np.isfinite(now), now, -np.inf)
        nearest = np.minimum(np.minimum(here[beam - 1], here[beam]), here[(beam + 1) % n])
        slack = _NOISE_M + _NOISE_SHARE * beams.before
        through: NDArray[np.bool_] = known & (nearest > np.hypot(x, y) + _THROUGH * slack)
    return through


def _grow(held: NDArray[np.bool_], beams: _Beams, scan: Scan) -> None:
    """Take in neighbours that have long had the same range: through the middle of a part of the
    robot nothing is ever seen.
    """
    now, n, step = scan.ranges, len(scan), scan.angle_increment
    closes = step * n > math.tau - 2.0 * step
    waiting = (beams.steady >= _STEADY) & ~held
    front = [int(beam) for beam in np.flatnonzero(held)]
    while front:
        beam = front.pop()
        beside = [b % n for b in (beam - 1, beam + 1) if closes or 0 <= b < n]
        for b in (b for b in beside if waiting[b]):
            if abs(now[b] - beams.level[beam]) < 2.0 * (_NOISE_M + _NOISE_SHARE * now[b]):
                held[b], waiting[b] = True, False
                beams.level[b], beams.votes[b] = now[b], _VOTES
                front.append(b)


def _runs(mask: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    """Runs of at least `least` beams, first and one past the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2) if b - a >= least]


def _floor(line: tuple[float, float], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where each beam meets a line [m], inf where it does so too slantingly to tell."""
    ahead = np.cos(angles - line[1])
    with np.errstate(divide="ignore"):
        return np.where(ahead > _STEEPEST, line[0] / ahead, np.inf)


def _are_alike(one: tuple[float, float], other: tuple[float, float]) -> bool:
    turn = math.remainder(one[1] - other[1], math.tau)
    return abs(one[0] - other[0]) < _ALIKE_SHARE * other[0] and abs(turn) < _ALIKE_RAD


def _is_overlooked(
    line: tuple[float, float], ranges: NDArray[np.float64], angles: NDArray[np.float64]
) -> bool:
    """Whether beams see beyond a line that would be in their way."""
    floor = _floor(line, angles)
    with np.errstate(invalid="ignore"):
        short, share = _THROUGH * _NOISE_M, _THROUGH * _NOISE_SHARE
        reached = np.isfinite(ranges) & (ranges > (1.0 - share) * floor - short)
        beyond = reached & (ranges > (1.0 + share) * floor + short)
    return bool(np.count_nonzero(beyond) > max(2.0, _MOST_BEYOND * np.count_nonzero(reached)))


def _line(level: NDArray[np.float64], angles: NDArray[np.float64]) -> tuple[float, float] | None:
    """Distance and direction of the straight line on which points lie, None where they do not."""
    points = np.column_stack([level * np.cos(angles), level * np.sin(angles)])
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle, full_matrices=False)
    length, across = spread * math.sqrt(12.0 / len(points)), axes[1]
    distance = float(across @ middle)
    if distance < 0.0:
        across, distance = -across, -distance
    limit = 4.0 * (_NOISE_M + _MOST_LINE_SHARE * distance)
    if length[0] < _LEAST_LINE_M or length[1] > min(limit, 0.3 * length[0]):
        return None
    return distance, math.atan2(float(across[1]), float(across[0]))
