"""Following one robot by the thesis's matcher alone, where the configuration says `thesis`.

Steps of `ThesisTracker.track`:
 1. line segments, edges and relations of the scan (chapters 3 and 4);
 2. match it to the last keyframe, the scan before and older keyframes (chapter 5 with §5.7's order
    of extraction) until two of them agree where it was taken; there, walls of it or of any of them
    must not stand where the other saw free space;
 3. where all matching line segments are parallel, the way along them is the wheels', else that of
    the step before: Algorithm 9 knows none, and the information says so;
 4. where no reference is matched, say so: a few scans are skipped, then the track is lost. Stamps
    decide nothing.

The text matches each scan to the one before and believes every answer (`lineloom experiment`); a
map that corrects nothing cannot be served. What a step is worth is told by the line segments
matched: the thesis has no covariance.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.config import TrackerConfig
from lineloom_core.mapping.facts.tracker import Tracked
from lineloom_core.matching.free_space import judge_sweeps
from lineloom_core.matching.local_map import Cloud
from lineloom_core.matching.result import MatchResult
from lineloom_core.matching.thesis import Description, ThesisConfig, ThesisMatcher
from lineloom_core.matching.thesis.matcher import RIVAL_ANGLE, RIVAL_DISTANCE
from lineloom_core.scan import Scan
from lineloom_core.timing import timed

_MATCHER = ThesisMatcher(ThesisConfig(order_extension=True))
_KEYFRAMES = 3
"""How many of the last ones a scan is matched to, at most."""
_POINT_SIGMA = 0.06
"""Of a beam across its line [m]: steps of simulated drives were off by that much, as Algorithms 8
and 9 rest on intersections and not on points."""
_SMOOTHING_S = 0.3


@storable("thesis-sight", shared=True)
@dataclass(eq=False)
class _Sight:
    """A scan with its pose in the track's frame, once it has one."""

    features: ScanFeatures
    pose: Pose

    @cached_property
    def described(self) -> Description:
        """Its primitives and relations: a function of the sweep."""
        f = self.features
        return _MATCHER.prepare(Scan(f.ranges, f.angle_min, f.angle_increment, 0.0, math.inf, 0.0))


@dataclass(frozen=True, eq=False)
class _Answer:
    """Where one reference puts the scan. along: direction in the track's frame [rad], not known."""

    reference: _Sight
    pose: Pose
    along: float | None
    result: MatchResult
    conflict: float

    def is_sure(self, due: Pose) -> bool:
        """Whether it needs no other; parallel lines are common, and have to agree with the motion.

        due: where the motion so far would have led.
        """
        if self.along is not None:
            return self.agrees(due)
        return self.result.verdict == "match"

    def agrees(self, pose: Pose, along: float | None = None) -> bool:
        """Whether another pose, not known along that direction, is the same as far as is known."""
        dx, dy = self.pose.x - pose.x, self.pose.y - pose.y
        for unknown in (self.along, along):
            if unknown is not None:
                across = -math.sin(unknown) * dx + math.cos(unknown) * dy
                dx, dy = -math.sin(unknown) * across, math.cos(unknown) * across
        turned = abs(angle_difference(self.pose.theta, pose.theta))
        return math.hypot(dx, dy) < RIVAL_DISTANCE and turned < RIVAL_ANGLE


@storable(
    "thesis-tracker",
    _config=TrackerConfig,
    _keyframes=deque[_Sight],
    _latest=_Sight | None,
    _step=Pose,
    _stamp=float,
    _odometry=Pose | None,
    _turn_rate=float,
    _misses=int,
    _missed=_Sight | None,
)
class ThesisTracker:
    """The state of one track: its last keyframes and its latest scan."""

    def __init__(self, config: TrackerConfig | None = None) -> None:
        self._config = config or TrackerConfig()
        self._keyframes: deque[_Sight] = deque(maxlen=_KEYFRAMES)
        self._latest: _Sight | None = None
        self._step = Pose.identity()
        self._stamp = 0.0
        self._odometry: Pose | None = None
        self._turn_rate = 0.0
        self._misses = 0
        self._missed: _Sight | None = None  # the scan before, where it was matched to nothing

    @property
    def turn_rate(self) -> float:
        """Turn rate over the last few steps [rad/s], 0 where it is not known."""
        return self._turn_rate

    @timed("track")
    def track(
        self, features: ScanFeatures, cloud: Cloud, stamp: float, odometry: Pose | None = None
    ) -> Tracked:
        """Place the next scan; `odometry` is T_odom_laser where the robot has any."""
        here = _Sight(features, Pose.identity())
        if self._latest is None:
            self._accept(here, stamp, odometry, is_keyframe=True)
            return Tracked("first", here.pose, True, np.zeros((3, 3)))
        answer = self._match(here, odometry)
        if answer is None:
            return self._miss(here)
        # Processors differ in the last bits, and a keyframe's place would be amplified by them.
        p = answer.pose
        here.pose = Pose(round(p.x, 6), round(p.y, 6), round(p.theta, 7))
        moved_on = self._moved_on(answer)
        self._accept(here, stamp, odometry, is_keyframe=moved_on)
        information = _information(here, answer.result)
        checks = {"conflict_share": answer.conflict}
        return Tracked("tracked", here.pose, moved_on, information, checks)

    def _miss(self, here: _Sight) -> Tracked:
        """Skip a few scans; not even two where the robot moves on by a keyframe's distance each.

        It shows where these match each other: what comes next sees still less of the track.
        """
        self._misses += 1
        before, self._missed = self._missed, here
        lost = self._misses >= self._config.patience
        if before is not None and not lost:
            found = _MATCHER.match_prepared(before.described, here.described)
            T = found.T_reference_current if found.verdict == "match" else None
            lost = T is not None and math.hypot(T.x, T.y) > self._config.keyframe_distance
        return Tracked("lost" if lost else "skipped", None, False, np.zeros((3, 3)))

    def _match(self, here: _Sight, odometry: Pose | None) -> _Answer | None:
        """Ask references until two agree; else believe who is sure, or whom another agrees with."""
        answers: list[_Answer] = []
        for reference in self._references():
            answer = self._ask(reference, here, odometry)
            if answer is None:
                continue
            answers.append(answer)
            agreeing = _agreeing(answer, answers)
            clear = max(a.conflict for a in agreeing) <= self._config.new_conflict
            if len(agreeing) > 1 and clear:
                return next((a for a in agreeing if a.along is None), agreeing[0])
        due = self._predicted(odometry)
        left = [a for a in answers if a.is_sure(due) or len(_agreeing(a, answers)) > 1]
        return max(left, key=lambda a: (a.along is None, _evidence(a, answers)), default=None)

    def _references(self) -> Iterator[_Sight]:
        """The last keyframe, from which little drift comes; the scan before, which is nearest."""
        last, *older = reversed(self._keyframes)
        yield last
        if self._latest is not None and self._latest is not last:
            yield self._latest
        yield from older

    def _ask(self, reference: _Sight, here: _Sight, odometry: Pose | None) -> _Answer | None:
        result = _MATCHER.match_prepared(reference.described, here.described)
        T = result.T_reference_current or result.best
        if T is None or not _says_something(result):
            return None
        pose, along = reference.pose @ T, None
        if result.weak_direction is not None:
            along = result.weak_direction + reference.pose.theta
            pose = _slid(pose, along, self._predicted(odometry))
        conflict = max(
            judge_sweeps(r.features, here.features, r.pose.between(pose)).conflict_share
            for r in self._references()
        )
        if conflict > self._most_conflict(pose, odometry):
            return None
        return _Answer(reference, pose, along, result, conflict)

    def _most_conflict(self, pose: Pose, odometry: Pose | None) -> float:
        """Less where the step is out of line with the one before: rooms look alike, people walk."""
        usual = RIVAL_DISTANCE + math.hypot(self._step.x, self._step.y)
        in_line = pose.distance(self._predicted(odometry)) < usual
        return self._config.gap_conflict if in_line else self._config.new_conflict

    def _predicted(self, odometry: Pose | None) -> Pose:
        """Where the wheels say the scan was taken, else the same step again."""
        assert self._latest is not None
        if odometry is not None and self._odometry is not None:
            return self._latest.pose @ self._odometry.between(odometry)
        return self._latest.pose @ self._step

    def _moved_on(self, answer: _Answer) -> bool:
        """Whether the scan is to be a keyframe: also where the last one does not reach it."""
        last = self._keyframes[-1]
        step = last.pose.between(answer.pose)
        return (
            answer.reference is not last
            or math.hypot(step.x, step.y) > self._config.keyframe_distance
            or abs(step.theta) > self._config.keyframe_angle
        )

    def _accept(
        self, here: _Sight, stamp: float, odometry: Pose | None, *, is_keyframe: bool
    ) -> None:
        if self._latest is not None:
            self._step = self._latest.pose.between(here.pose)
            dt = stamp - self._stamp
            if 0.01 < dt < 1.0:
                rate, share = self._step.theta / dt, dt / (dt + _SMOOTHING_S)
                self._turn_rate += share * (rate - self._turn_rate)
            elif dt >= 1.0:
                self._turn_rate = 0.0
        self._latest, self._stamp, self._odometry = here, stamp, odometry
        self._misses, self._missed = 0, None
        if is_keyframe:
            self._keyframes.append(here)


def _says_something(result: MatchResult) -> bool:
    """Whether an answer counts, once another agrees, that the matcher itself may doubt."""
    if result.verdict in ("match", "weak"):
        return True
    checks, config = result.checks, _MATCHER.config
    agree = checks["pairs"] >= config.least_pairs and checks["edges"] > 0
    return agree and checks["spread"] <= config.most_spread


def _agreeing(answer: _Answer, answers: list[_Answer]) -> list[_Answer]:
    return [a for a in answers if a.agrees(answer.pose, answer.along)]


def _evidence(answer: _Answer, answers: list[_Answer]) -> float:
    """How likely all that agree are, the less the more stands in free space."""
    return sum(a.result.score * (1.0 - a.conflict) for a in _agreeing(answer, answers))


def _slid(pose: Pose, along: float, predicted: Pose) -> Pose:
    """The pose, moved along a direction to where the prediction is."""
    c, s = math.cos(along), math.sin(along)
    slide = c * (predicted.x - pose.x) + s * (predicted.y - pose.y)
    return Pose(pose.x + slide * c, pose.y + slide * s, pose.theta)


def _information(here: _Sight, result: MatchResult) -> NDArray[np.float64]:
    """What the points of the matching line segments tell of x, y, theta, in the laser's axes.

    A line's points count as two at a distance of length / sqrt(12) from its middle: the same
    moments.
    """
    L = here.described.primitives.L
    m = np.array([pair.current for pair in result.pairs], dtype=np.int64)
    u = np.column_stack([np.cos(L.directions[m]), np.sin(L.directions[m])])
    n = np.column_stack([-u[:, 1], u[:, 0]])
    arm = u * (L.lengths[m] / math.sqrt(12.0))[:, None]
    middle = 0.5 * (L.s + L.e)[m]
    points = 0.5 * (np.abs(L.last - L.first)[m] + 1) / _POINT_SIGMA**2
    found = np.zeros((3, 3))
    for p in (middle - arm, middle + arm):
        J = np.column_stack([n, n[:, 1] * p[:, 0] - n[:, 0] * p[:, 1]])
        found += (J * points[:, None]).T @ J
    return found
