"""Following one robot from scan to scan, without odometry and by no clock.

Steps of `Tracker.track`:
 1. expect the step that steady driving would make (`motion`), and the one that believed wheels say;
 2. where steps have been small and even, search a window around each, register the best by points
    and normals against what stood still (`recent`): people walk;
 3. where that does not fit, or where steps are large, uneven or after a pause, search by evidence,
    from no pose (`step_search`);
 4. along the direction that is known least, weigh what is expected in by what is known, and wheels
    that have proven right in all; what a scan does not show is as expected (`freedom`);
 5. check: enough of the scan must lie on known surfaces, hardly any of it where keyframes saw free
    space, and nothing else may fit as well; after a pause, more and less of it;
 6. where nothing fits, wheels carry a scan that contradicts nothing. Else say so. A few such scans
    are skipped (somebody stood before the lidar), more while wheels say where the robot goes; then
    the track is lost and a new one begins without any link.

Departs from the design's line tracker: registration against averaged points of the last
keyframes needs no special case for scans without lines. Without loops MIT CSAIL comes out within
0.2 to 0.6 m after 290 m; what loops leave of that is the graph's business.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.checks import TRACKED
from lineloom_core.codec import storable
from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.graph import observe, project_out_weak
from lineloom_core.mapping.config import TrackerConfig
from lineloom_core.mapping.facts.drift import MEASURED_SHORT, NoiseFigure
from lineloom_core.mapping.facts.freedom import Freedom, free_turn, least_known_turn
from lineloom_core.mapping.facts.fused import (
    fused,
    in_own_axes,
    is_near,
    unobserved,
    without_last_bits,
)
from lineloom_core.mapping.facts.motion import Expected, Motion
from lineloom_core.mapping.facts.recent import Recent
from lineloom_core.mapping.facts.step_search import search_step, spotter_of
from lineloom_core.mapping.facts.wheels import Wheels
from lineloom_core.matching.free_space import judge_sweeps
from lineloom_core.matching.local_map import Cloud, LocalMap, Registration
from lineloom_core.timing import timed

_SETTLED = 0.12  # m: the gate with which a registration ends
_PRIOR = 0.15, 0.05  # m, rad: what a step in steady driving, or wheels, are good for
_ROLLED = 0.05, 0.03  # m, rad: what wheels are good for where a scan is to be held by them
_AS_GOOD = 0.02  # of the score of a guess: what differs by less is no better
_STEP, _OFF = (0.02, 0.01), 0.1  # m, rad, and share of a step that proven wheels are off by
_MOST_CONTRADICTED = 2.0  # of a scan that only wheels place
_STIRRED = 0.1, 0.1  # m, rad: less is no motion
_OUT_OF_SIGHT = 2.5  # m: after it nothing is to be found again
_LONGER = 10  # times the patience, while wheels say where it goes
_SKIPPED = 4.0  # intervals that a skipped scan counts for
_USUAL_WAY = 0.2  # m: steps up to here are predicted within `prior_sigma`
_WINDOW = 0.2, 0.08, 0.1, 0.12  # m, m an interval, rad, rad an interval: searched around a step

Status = Literal["first", "tracked", "skipped", "lost"]


@dataclass(frozen=True, eq=False)
class Tracked:
    """What became of a scan.

    pose: of the laser in the track's own frame (None unless placed). is_keyframe: the scan should
    become one. information: 3x3 at the pose, order x, y, theta, in the laser's axes.
    """

    status: Status
    pose: Pose | None
    is_keyframe: bool
    information: NDArray[np.float64]
    checks: dict[str, float] = field(default_factory=dict)
    noise: float = 1.0
    """The robot's noise figure so far (see `drift`)."""
    unseen: tuple[float, float] = _PRIOR
    """What is known of the step where nothing is observed [m, rad]."""


@dataclass(frozen=True, slots=True)
class _Found:
    """Where a scan was found. freedom: how it could move there unnoticed, None where it cannot.

    figures: of a search, none where the scan was followed.
    """

    at: Registration
    freedom: Freedom | None = None
    figures: dict[str, float] = field(default_factory=dict)


@storable(
    "tracker",
    _config=TrackerConfig,
    _recent=Recent,
    _motion=Motion,
    _pose=Pose,
    _odometry=Pose | None,
    _stamp=float,
    _misses=int,
    _noise=NoiseFigure,
    _wheels=Wheels,
)
class Tracker:
    """The state of one track: a local map, the last pose and how the robot moves."""

    def __init__(self, config: TrackerConfig | None = None) -> None:
        self._config = config or TrackerConfig()
        self._recent = Recent(self._config.memory, self._config.noisy_memory)
        self._motion = Motion()
        self._pose = Pose.identity()
        self._odometry: Pose | None = None
        self._stamp = 0.0
        self._misses = 0
        self._noise = NoiseFigure()
        self._wheels = Wheels()

    @property
    def turn_rate(self) -> float:
        """Turn rate over the last few steps [rad/s], 0 where it is not known."""
        return self._motion.turn_rate

    def surroundings(self, stamp: float) -> tuple[LocalMap, tuple[Pose, ...], float]:
        """What was seen last, where a scan was likely taken, the last step's turn rate [rad/s]."""
        motion = self._motion
        return self._recent.map, motion.expect(stamp).predictions[:2], motion.last_rate

    @timed("track")
    def track(
        self, features: ScanFeatures, cloud: Cloud, stamp: float, odometry: Pose | None = None
    ) -> Tracked:
        """Place the next scan; `odometry` is T_odom_laser where the robot has any."""
        if not len(self._recent):
            self._motion.begin(self._pose, stamp)
            self._stamp, self._odometry = stamp, odometry
            self._add_keyframe(features, cloud)
            return Tracked("first", self._pose, True, np.zeros((3, 3)))
        expected = self._motion.expect(stamp)
        rolled = self._rolled(expected, odometry)
        trusted = rolled is not None and self._wheels.believed
        if expected.gap > self._config.longest_silence and not trusted:
            return _nowhere("lost")
        if trusted:
            assert rolled is not None
            expected = expected.with_wheels(self._pose @ rolled)
        found = self._find(features, cloud, expected)
        if rolled is not None:
            self._hold_wheels(rolled, found)
        # Wheels know the way that scans do not show; elsewhere velocity has less of a bias.
        due = expected.nearest(found.at.pose)
        hidden = found.freedom is not None or self._unseen(found) is not None
        if trusted and (hidden or self._wheels.proven):
            due = expected.predictions[-1]
        at = without_last_bits(self._held(found, due, expected))
        checks = self._figures(features, at, expected, trusted=trusted) | found.figures
        if not TRACKED.against(self._config, checks):
            known = self._known_of(expected, trusted)
            return self._placed(features, cloud, at, stamp, odometry, checks, known)
        self._misses += 1
        if trusted:
            assert rolled is not None
            carried = self._carried(features, cloud, self._pose @ rolled)
            if carried is not None:
                return self._placed(features, cloud, carried, stamp, odometry, checks, _PRIOR)
        return _nowhere(self._given_up(rolled if trusted else None), checks)

    def _placed(
        self,
        features: ScanFeatures,
        cloud: Cloud,
        at: Registration,
        stamp: float,
        odometry: Pose | None,
        checks: dict[str, float],
        known: tuple[float, float],
    ) -> Tracked:
        """Take a step that is believed. known: of it where nothing is observed [m, rad]."""
        self._misses = 0
        self._accept(at.pose, stamp, odometry)
        moved_on = self._moved_on(at, checks["conflict_share"])
        if moved_on:
            self._measure_noise(cloud, at.pose)
            self._add_keyframe(features, cloud)
        information = in_own_axes(at)
        return Tracked("tracked", at.pose, moved_on, information, checks, self._noise.value, known)

    def _carried(self, features: ScanFeatures, cloud: Cloud, rolled: Pose) -> Registration | None:
        """Where wheels say that a scan which fits nowhere was taken, if it contradicts nothing.

        So a narrow view goes round a corner, or past a wall too plain to be known by.
        """
        way, turn = (sigma**-2 for sigma in _ROLLED)
        found = self._recent.map.register(cloud, rolled, prior=(way, way, turn))
        off = rolled.distance(found.pose), abs(rolled.between(found.pose).theta)
        if found.fit < self._config.least_fit or off[0] > _PRIOR[0] or off[1] > _PRIOR[1]:
            found = Registration(rolled, np.zeros((3, 3)), 0.0, 1.0, 0.0)
        spotter = spotter_of(self._recent, features, cloud)
        [spot] = spotter.settle([found.pose], gate=_SETTLED, iterations=0, near=0.0)
        return without_last_bits(found) if spot.contradicted <= _MOST_CONTRADICTED else None

    def _given_up(self, rolled: Pose | None) -> Status:
        """Whether to wait for a better scan: longer while wheels say where the robot goes."""
        if rolled is not None and self._misses < _LONGER * self._config.patience:
            way, turn = math.hypot(rolled.x, rolled.y), abs(rolled.theta)
            if _STIRRED[0] < way < _OUT_OF_SIGHT or (turn > _STIRRED[1] and way < _OUT_OF_SIGHT):
                return "skipped"
        return "lost" if self._misses >= self._config.patience else "skipped"

    def _figures(
        self, features: ScanFeatures, at: Registration, expected: Expected, *, trusted: bool
    ) -> dict[str, float]:
        """What every step is held to. A scan that was skipped is as good as a pause; where wheels
        say what it was, there was none.
        """
        known = trusted and is_near(at.pose, expected.predictions[-1])
        return {
            "fit": at.fit,
            "conflict_share": self._conflict(features, at.pose),
            "gap": 1.0 if known else max(expected.gap, _SKIPPED * self._misses),
            "noise": self._noise.value,
        }

    def _moved_on(self, found: Registration, conflict: float) -> bool:
        """Whether the scan is to be a keyframe."""
        config, step = self._config, self._recent.latest[1].between(found.pose)
        return (
            math.hypot(step.x, step.y) > config.keyframe_distance
            or abs(step.theta) > config.keyframe_angle
            or found.fit < config.enough_fit
            or conflict > config.new_conflict
        )

    @property
    def _is_noisy(self) -> bool:
        return self._noise.value > self._config.noisy_above

    def _rolled(self, expected: Expected, odometry: Pose | None) -> Pose | None:
        """The step that the wheels have made, None where they cannot have."""
        if odometry is None or self._odometry is None:
            return None
        step = self._odometry.between(odometry)
        intervals = max(expected.gap, 1.0 + self._misses)
        return step if self._wheels.plausible(step, self._motion.usual, intervals) else None

    def _hold_wheels(self, rolled: Pose, found: _Found) -> None:
        """Hold the wheels against what was found, where it is known."""
        if found.freedom is None or found.freedom.axis is not None:
            step, seen = self._pose.between(found.at.pose), observe(found.at.information)
            known = seen.lambda_max if self._unseen(found) is not None else seen.lambda_min
            short = MEASURED_SHORT * self._noise.value
            sigma = math.sqrt(short / max(known, 1.0)), math.sqrt(short / max(seen.rotation, 1.0))
            self._wheels.compare(rolled, step, self._unseen(found), sigma)

    def _find(self, features: ScanFeatures, cloud: Cloud, expected: Expected) -> _Found:
        """Steps 2 and 3."""
        if expected.steady:
            followed = self._follow(cloud, expected)
            if self._is_sure(followed, features, expected):
                figures = {"surprise": expected.surprise(followed.pose)}
                return _Found(followed, self._free_turn(features, cloud, followed), figures)
        searched = search_step(self._recent, features, cloud, self._pose, expected)
        figures = {
            "matched": searched.best.matched,
            "misfit": searched.best.misfit,
            "cost": searched.cost,
            "lead": searched.lead,
            "backed": float(searched.backing == "match"),
            "wall": searched.best.matched * features.wall,
            "turn": abs(self._pose.between(searched.best.pose).theta),
        }
        if expected.paced:  # who drives evenly and then is elsewhere was carried
            figures["surprise"] = expected.surprise(searched.best.pose)
        at, freedom = self._by_what_stood_still(cloud, searched.best.found), searched.freedom
        return _Found(at, freedom and replace(freedom, at=at.pose), figures)

    def _free_turn(
        self, features: ScanFeatures, cloud: Cloud, found: Registration
    ) -> Freedom | None:
        """The turn that a scan which was followed does not show."""
        if least_known_turn(found.information) is None:
            return None
        spotter = spotter_of(self._recent, features, cloud)
        [spot] = spotter.settle([found.pose], gate=_SETTLED, iterations=0, near=0.0)
        return free_turn(spotter, spot)

    def _is_sure(self, found: Registration, features: ScanFeatures, expected: Expected) -> bool:
        """Whether a scan that was followed needs no search."""
        config = self._config
        return (
            found.fit >= config.enough_fit
            and expected.explains(found.pose)
            and self._conflict(features, found.pose) <= config.new_conflict
        )

    def _unseen(self, found: _Found) -> float | None:
        """Direction in the last pose's axes that a registration did not observe."""
        along = found.freedom.axis if found.freedom else None
        if along is None:
            along = unobserved(found.at, self._config.least_isotropy)
        return None if along is None else along - self._pose.theta

    def _follow(self, cloud: Cloud, expected: Expected) -> Registration:
        """Register the best find around any prediction; sure of no more than what stood still."""
        best: tuple[Pose, float] | None = None
        stretch = min(max(expected.gap, 1.0), 3.0)
        lead = -_AS_GOOD if self._wheels.proven else _AS_GOOD
        for guess in expected.predictions:
            pose, score = self._recent.map.search(
                cloud,
                guess,
                reach_xy=_WINDOW[0] + _WINDOW[1] * stretch,
                reach_theta=_WINDOW[2] + _WINDOW[3] * stretch,
            )
            # Odometry, the last, must fit clearly better to be believed, until it is proven.
            if best is None or score > best[1] + lead:
                best = pose, score
        assert best is not None
        hold = 1.0 / self._config.prior_sigma**2
        found = self._recent.map.register(cloud, best[0], prior=(hold, hold, hold))
        return self._by_what_stood_still(cloud, found, best[0])

    def _by_what_stood_still(
        self, cloud: Cloud, found: Registration, guess: Pose | None = None
    ) -> Registration:
        """The same by steady points alone, where enough of what fits stood still."""
        hold = 1.0 / self._config.prior_sigma**2
        prior = (hold, hold, hold)
        steady = self._recent.steady.register(cloud, guess or found.pose, prior=prior)
        if steady.matched < self._config.steady_share * found.matched:
            return found  # all is new here
        placed = self._recent.map.register(cloud, steady.pose, gate=_SETTLED, iterations=0)
        return replace(placed, information=steady.information)

    def _known_of(self, expected: Expected, trusted: bool) -> tuple[float, float]:
        """What is known of a step [m, rad] where registration observes nothing."""
        if trusted or expected.steady:
            return _PRIOR
        return max(expected.width, _PRIOR[0]), _PRIOR[1]

    def _held(self, found: _Found, due: Pose, expected: Expected) -> Registration:
        """The same, along the direction that is known least as near what is due as that is known.

        Between two plain walls, noise alone would choose the slide, and momentum would keep it.
        """
        at, config = found.at, self._config
        if found.freedom is not None:
            # Any slide fits as well: what is due is as good as any, unless the matcher is sure.
            free = replace(found.freedom, at=at.pose)
            pose = free.nearest(due, 1.0 - found.figures.get("backed", 0.0))
            return replace(at, pose=pose, information=free.unknown(at.information))
        noise = MEASURED_SHORT * max(self._noise.value, 1e-3)
        if self._wheels.proven and due is expected.predictions[-1]:
            step = self._pose.between(due)
            off = self._wheels.off
            way = _STEP[0] + _OFF * math.hypot(step.x, step.y) + 2.0 * off[0]
            turn = _STEP[1] + _OFF * abs(step.theta) + 2.0 * off[1]
            pose = fused(at, due, at.information / noise, way, turn)
        else:
            seen = observe(at.information)
            way = max(self._motion.usual[0] / _USUAL_WAY, 1.0)
            sigma = config.prior_sigma * way * max(expected.gap, 1.0)
            slide = Freedom.along(at.pose, seen.least_known)
            pose = slide.nearest(due, 1.0 / (1.0 + seen.lambda_min / noise * sigma**2))
        weak_below = config.least_isotropy * observe(at.information).lambda_max
        return replace(
            at, pose=pose, information=project_out_weak(at.information, weak_below=weak_below)
        )

    def _conflict(self, features: ScanFeatures, pose: Pose) -> float:
        keyframe, at = self._recent.latest
        return judge_sweeps(keyframe, features, at.between(pose)).conflict_share

    def _measure_noise(self, cloud: Cloud, pose: Pose) -> None:
        disagreement = self._recent.map.disagreement(cloud, pose)
        if disagreement is not None:
            self._noise.add(disagreement)

    def _accept(self, pose: Pose, stamp: float, odometry: Pose | None) -> None:
        self._motion.add(pose, stamp)
        self._pose, self._stamp, self._odometry = pose, stamp, odometry

    def _add_keyframe(self, features: ScanFeatures, cloud: Cloud) -> None:
        """More keyframes in the local map where a noisy lidar makes each worth less."""
        config = self._config
        depth = config.noisy_memory if self._is_noisy else config.memory
        self._recent.add(features, cloud, self._pose, depth=depth)


def _nowhere(status: Status, checks: dict[str, float] | None = None) -> Tracked:
    return Tracked(status, None, False, np.zeros((3, 3)), checks or {})
