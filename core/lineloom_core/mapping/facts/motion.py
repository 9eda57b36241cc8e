"""What a robot's next step may be: like its last ones, give or take what its clock tells.

A clock is a prior with a width: only ratios of its intervals count, so it may run in any unit;
where it stands still or goes back it says nothing, and a step is like the last one. Who asks may
still end a track after `tracker.longest_silence`, for then the robot may have been carried.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose, angle_difference

_NARROW = 0.12, 0.08  # m, rad: what steady driving is predicted within
_WIDE = 0.6, 0.5  # m, rad: what a step is known within before there was any, and after a pause
_SHARE = 0.6  # of the usual step that the next may differ by
_STEADY = 0.35, 0.3  # m, rad: steps up to here leave no room for another hypothesis in between
_INTERVALS = 12  # of the clock that say what is usual
_KEPT = 0.9  # of what is usual that is kept from step to step
_KINDS = 8  # steps that the next may be like
_ALIKE = 0.3, 0.15  # m, rad: up to here two steps are of one kind
PAUSE = 3.0  # usual intervals after which the last step's velocity means nothing
_FARTHEST = 15.0  # usual intervals over which the mean velocity is carried on
_LONG = 16.0  # usual intervals that no pause is longer than while there were but few
_MEAN_OF = 6  # poses that it is the mean over
_MOST_STRETCH = 2.0  # times the last step: where scans arrive in bursts, stamps lie
_SMOOTHING_S = 0.3
_PACED = 1.0  # m: who has not driven as far may only just have started


@dataclass(frozen=True, slots=True)
class Expected:
    """Where the next scan may have been taken.

    predictions: of the laser in the track's frame. width [m], turn [rad]: how far off they may be.
    gap: time since the last scan over the usual interval; 1 where the clock does not tell. steady:
    steps have been so small and even that following them needs no search. paced: it has driven far
    enough to have shown how large its steps are.
    """

    predictions: tuple[Pose, ...]
    width: float
    turn: float
    gap: float
    steady: bool
    paced: bool = False

    def with_wheels(self, rolled: Pose) -> Expected:
        """The same with what the wheels say, last."""
        return replace(self, predictions=(*self.predictions, rolled))

    def nearest(self, pose: Pose) -> Pose:
        """The prediction that a pose is nearest to."""
        return min(self.predictions, key=lambda p: self._surprise(p, pose))

    def surprise(self, pose: Pose) -> float:
        """Minus the log-likelihood of a pose, with heavy tails; 0 where it was predicted."""
        return min(self._surprise(p, pose) for p in self.predictions)

    def _surprise(self, predicted: Pose, pose: Pose) -> float:
        d = predicted.distance(pose) / self.width
        a = angle_difference(pose.theta, predicted.theta) / self.turn
        return math.log1p(d * d + a * a)

    def explains(self, pose: Pose) -> bool:
        """Whether a pose is as near to a prediction as steady driving is."""
        return any(
            p.distance(pose) < self.width and abs(angle_difference(p.theta, pose.theta)) < self.turn
            for p in self.predictions
        )


@storable(
    "motion",
    _stamp=float,
    _intervals=deque[float],
    _step=Pose,
    _stretch=float,
    _usual=tuple[float, float],
    _way=deque[Pose],
    _kinds=deque[Pose],
    _steps=int,
    _driven=float,
    _turn_rate=float,
    _last_rate=float,
)
class Motion:
    """The last steps of one track."""

    def __init__(self) -> None:
        self._stamp = 0.0
        self._intervals: deque[float] = deque(maxlen=_INTERVALS)
        self._step = Pose.identity()
        self._stretch = 1.0  # usual intervals that the last step took
        self._usual = _WIDE  # m, rad: what steps are usually like
        self._way: deque[Pose] = deque(maxlen=_MEAN_OF)
        self._kinds: deque[Pose] = deque(maxlen=_KINDS)
        self._steps = 0
        self._driven = 0.0
        self._turn_rate = 0.0
        self._last_rate = 0.0

    @property
    def turn_rate(self) -> float:
        """Turn rate over the last few steps [rad/s], 0 where it is not known.

        Smoothed: a single step's is mostly noise, and would wind up the next sweep.
        """
        return self._turn_rate

    @property
    def last_rate(self) -> float:
        """Turn rate over the last step alone [rad/s], 0 where it is not known."""
        return self._last_rate

    @property
    def usual(self) -> tuple[float, float]:
        """What a step is usually like [m, rad]."""
        return self._usual

    def expect(self, stamp: float) -> Expected:
        """What to expect of a scan of this stamp."""
        last, gap = self._way[-1], self._gap(stamp)
        if gap > PAUSE:
            predictions = [last]
            if gap <= _FARTHEST and len(self._way) > 1:
                mean = _scaled(self._way[0].between(last), gap / (len(self._way) - 1))
                predictions.append(last @ mean)
            return Expected(tuple(predictions), *_WIDE, gap, False)
        stretch = min(gap / self._stretch, _MOST_STRETCH) if self._steps else 0.0
        width, turn = (
            min(max(n, _SHARE * u * max(gap, 1.0)), w)
            for n, u, w in zip(_NARROW, self._usual, _WIDE, strict=True)
        )
        small = self._usual[0] < _STEADY[0] and self._usual[1] < _STEADY[1]
        predictions = [last @ _scaled(self._step, stretch)]
        if small and self._steps > 1:
            return Expected(tuple(predictions), width, turn, gap, True, self._driven > _PACED)
        # Who turns on the spot and drives on in turns does what it did before, not just now.
        for step in reversed(self._kinds):
            if all(not _is_alike(last @ step, p) for p in predictions):
                predictions.append(last @ step)
        return Expected(tuple(predictions), width, turn, gap, False)

    def _gap(self, stamp: float) -> float:
        """Time since the last scan over the usual interval, 1 where the clock does not tell."""
        elapsed = stamp - self._stamp
        ordered = sorted(self._intervals)
        if elapsed <= 0.0 or len(ordered) < 2:
            return 1.0
        usual, long = ordered[len(ordered) // 2], ordered[-2]
        if long > PAUSE * usual:  # scans come in bursts: only what is longer than usual tells
            return elapsed / long if elapsed > PAUSE * long else 1.0
        gap = elapsed / usual if usual > 0.0 else _LONG
        return gap if len(ordered) == _INTERVALS else min(gap, _LONG)

    def begin(self, pose: Pose, stamp: float) -> None:
        """Take the first scan of a track."""
        self._stamp = stamp
        self._way.append(pose)

    def add(self, pose: Pose, stamp: float) -> None:
        """Take the next scan's pose."""
        step, gap = self._way[-1].between(pose), self._gap(stamp)
        elapsed = stamp - self._stamp
        self._turn(step.theta, elapsed)
        self._step, self._stretch = step, min(max(gap, 0.5), PAUSE)
        if gap <= PAUSE:
            way = math.hypot(step.x, step.y) / self._stretch
            turn = abs(step.theta) / self._stretch
            kept = _KEPT if self._steps else 0.0
            self._usual = max(way, kept * self._usual[0]), max(turn, kept * self._usual[1])
            self._kinds.append(step)
        self._intervals.append(max(elapsed, 0.0))
        if gap > PAUSE:
            self._way.clear()
        self._way.append(pose)
        self._stamp = stamp
        self._steps += 1
        self._driven += math.hypot(step.x, step.y)

    def _turn(self, turn: float, elapsed: float) -> None:
        self._last_rate = turn / elapsed if 0.01 < elapsed < 1.0 else 0.0
        if 0.01 < elapsed < 1.0:
            share = elapsed / (elapsed + _SMOOTHING_S)
            self._turn_rate += share * (turn / elapsed - self._turn_rate)
        elif elapsed >= 1.0:
            self._turn_rate = 0.0


def _is_alike(a: Pose, b: Pose) -> bool:
    return a.distance(b) < _ALIKE[0] and abs(angle_difference(a.theta, b.theta)) < _ALIKE[1]


def _scaled(step: Pose, factor: float) -> Pose:
    return Pose(step.x * factor, step.y * factor, step.theta * factor)
