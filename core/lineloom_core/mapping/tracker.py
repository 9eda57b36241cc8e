"""Following one robot from scan to scan, without odometry.

Steps of `Tracker.track`:
 1. predict the pose from the velocity of the last step (and from odometry that is believed);
 2. search a window around each prediction against the local map, wider the longer the gap;
 3. register the best by points and normals, the prediction holding only what nothing observes;
 4. check: enough of the scan must lie on known surfaces, and none of it where the keyframe saw
    free space;
 5. where nothing fits, say so. A few such scans are skipped (somebody stood before the lidar);
    then the track is lost and a new one begins without any link.

Departs from the design's line tracker: registration against averaged points of the last
keyframes needs no special case for scans without lines. Without loops MIT CSAIL comes out within
0.2 to 0.6 m after 290 m; what loops leave of that is the graph's business.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.graph import observe, project_out_weak
from lineloom_core.mapping.drift import NoiseFigure
from lineloom_core.mapping.wheels import Wheels
from lineloom_core.matching.free_space import judge_sweeps
from lineloom_core.matching.local_map import Cloud, LocalMap, Registration
from lineloom_core.timing import timed

_SMOOTHING_S = 0.3

Status = Literal["first", "tracked", "skipped", "lost"]


@dataclass(frozen=True, slots=True)
class TrackerConfig:
    """Parameters of the tracker; metres, radians, seconds.

    memory: keyframes in the local map; noisy_memory: in that of a robot whose noise figure (see
    `drift`) lies above noisy_above. keyframe_distance, keyframe_angle: how far to the next
    keyframe. least_fit: share of a scan that must lie on known surfaces; low, for a turn into a
    new room shows mostly new walls. enough_fit: below it the scan becomes a keyframe, since so
    much of it is new. most_conflict: share of
    it that may lie where the keyframe saw free space. patience: unfit scans in a row before the
    track is given up. longest_gap: silence after which velocity means nothing.
    prior_sigma [m, rad]: how firmly the prediction holds what little is observed. least_isotropy:
    smaller over greater information on the position, under which the smaller counts as none.
    """

    memory: int = 8
    noisy_memory: int = 32
    noisy_above: float = 1.2
    keyframe_distance: float = 0.4
    keyframe_angle: float = math.radians(20.0)
    least_fit: float = 0.2
    enough_fit: float = 0.6
    most_conflict: float = 0.3
    patience: int = 4
    longest_gap: float = 0.6
    prior_sigma: float = 0.1
    least_isotropy: float = 0.001


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
    fit: float
    conflict: float
    noise: float = 1.0
    """The robot's noise figure so far (see `drift`)."""


class Tracker:
    """The state of one track: a local map, the last pose and the last velocity."""

    def __init__(self, config: TrackerConfig | None = None) -> None:
        self._config = config or TrackerConfig()
        self._recent: deque[tuple[Cloud, Pose]] = deque(maxlen=self._config.noisy_memory)
        self._keyframe_features: ScanFeatures | None = None
        self._map: LocalMap | None = None
        self._pose = Pose.identity()
        self._twist = np.zeros(3)  # m/s, m/s, rad/s in the laser's axes
        self._twist_span = 0.0  # s over which it was measured
        self._turn_rate = 0.0
        self._stamp = 0.0
        self._odometry: Pose | None = None
        self._misses = 0
        self._noise = NoiseFigure()
        self._wheels = Wheels()

    def __getstate__(self) -> dict[str, Any]:
        """The local map is a function of the recent keyframes: left out."""
        return {**self.__dict__, "_map": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self._recent:
            self._map = self._local_map()

    @property
    def turn_rate(self) -> float:
        """Turn rate over the last few steps [rad/s], 0 where it is not known.

        Smoothed: a single step's is mostly noise, and would wind up the next sweep.
        """
        return self._turn_rate

    @timed("track")
    def track(
        self, features: ScanFeatures, cloud: Cloud, stamp: float, odometry: Pose | None = None
    ) -> Tracked:
        """Place the next scan; `odometry` is T_odom_laser where the robot has any."""
        if self._map is None:
            self._accept(Pose.identity(), stamp, odometry, moved_to=Pose.identity())
            self._add_keyframe(features, cloud)
            return Tracked("first", self._pose, True, np.zeros((3, 3)), 1.0, 0.0)
        rolled = self._rolled(stamp, odometry)
        trusted = rolled is not None and self._wheels.believed
        predictions = self._predict(stamp, rolled if trusted else None)
        found, held = self._register(cloud, predictions, stamp - self._stamp)
        if rolled is not None:
            self._wheels.compare(rolled, self._pose.between(found.pose), self._unseen(found))
        if trusted:
            found = held  # wheels know the way along a plain corridor
        conflict = self._conflict(features, found.pose)
        config = self._config
        if found.fit < config.least_fit or conflict > config.most_conflict:
            self._misses += 1
            status: Status = "lost" if self._misses >= config.patience else "skipped"
            return Tracked(status, None, False, np.zeros((3, 3)), found.fit, conflict)
        self._misses = 0
        self._accept(found.pose, stamp, odometry, moved_to=held.pose)
        step = self._recent[-1][1].between(found.pose)
        is_keyframe = (
            math.hypot(step.x, step.y) > config.keyframe_distance
            or abs(step.theta) > config.keyframe_angle
            or found.fit < config.enough_fit
        )
        if is_keyframe:
            self._measure_noise(cloud, found.pose)
            self._add_keyframe(features, cloud)
        information = _in_own_axes(held)
        return Tracked(
            "tracked", found.pose, is_keyframe, information, found.fit, conflict, self._noise.value
        )

    def _rolled(self, stamp: float, odometry: Pose | None) -> Pose | None:
        """The step that the wheels have made, None where they cannot have."""
        if odometry is None or self._odometry is None:
            return None
        step = self._odometry.between(odometry)
        return step if self._wheels.plausible(step, stamp - self._stamp) else None

    def _unseen(self, found: Registration) -> float | None:
        """Direction in the last pose's axes that a registration did not observe."""
        along = _unobserved(found, self._config.least_isotropy)
        return None if along is None else along - self._pose.theta

    def _predict(self, stamp: float, rolled: Pose | None) -> list[Pose]:
        """Where the robot may be: same velocity, and what its wheels say."""
        dt = min(max(stamp - self._stamp, 0.0), self._config.longest_gap)
        # Where scans arrive in bursts, stamps lie: two steps at most, whatever the clock says.
        dt = min(dt, 2.0 * self._twist_span)
        predictions = [self._pose @ Pose.from_array(self._twist * dt)]
        if rolled is not None:
            predictions.append(self._pose @ rolled)
        return predictions

    def _register(
        self, cloud: Cloud, predictions: list[Pose], dt: float
    ) -> tuple[Registration, Registration]:
        """Register the best find around any prediction; the same, held where nothing observes."""
        assert self._map is not None
        gap = min(max(dt, 0.2), 1.5)
        best: tuple[Pose, float] | None = None
        for guess in predictions:
            pose, score = self._map.search(
                cloud, guess, reach_xy=0.2 + 0.4 * gap, reach_theta=0.1 + 0.6 * gap
            )
            # Odometry must fit clearly better than constant velocity to be believed.
            if best is None or score > best[1] + 0.02:
                best = pose, score
        assert best is not None
        hold = 1.0 / self._config.prior_sigma**2
        found = self._map.register(cloud, best[0], prior=(hold, hold, hold))
        return found, _held_where_unseen(found, predictions[-1], self._config.least_isotropy)

    def _conflict(self, features: ScanFeatures, pose: Pose) -> float:
        assert self._keyframe_features is not None
        T_keyframe_laser = self._recent[-1][1].between(pose)
        return judge_sweeps(self._keyframe_features, features, T_keyframe_laser).conflict_share

    def _measure_noise(self, cloud: Cloud, pose: Pose) -> None:
        assert self._map is not None
        disagreement = self._map.disagreement(cloud, pose)
        if disagreement is not None:
            self._noise.add(disagreement)

    def _accept(self, pose: Pose, stamp: float, odometry: Pose | None, *, moved_to: Pose) -> None:
        """Take a pose. Velocity is that to `moved_to`: a slide that noise chose must not go on."""
        dt = stamp - self._stamp
        if 0.01 < dt < 1.0:  # steps of zero or less occur in real logs
            self._twist = self._pose.between(moved_to).to_array() / dt
            self._twist_span = dt
            share = dt / (dt + _SMOOTHING_S)
            self._turn_rate += share * (float(self._twist[2]) - self._turn_rate)
        elif dt >= 1.0:
            self._twist, self._turn_rate = np.zeros(3), 0.0
        self._pose, self._stamp, self._odometry = pose, stamp, odometry

    def _add_keyframe(self, features: ScanFeatures, cloud: Cloud) -> None:
        self._recent.append((cloud, self._pose))
        self._keyframe_features = features
        self._map = self._local_map()

    def _local_map(self) -> LocalMap:
        """The latest keyframes averaged; more of them where a noisy lidar makes each worth less."""
        noisy = self._noise.value > self._config.noisy_above
        memory = self._config.noisy_memory if noisy else self._config.memory
        return LocalMap.build(islice(reversed(self._recent), memory))


def _held_where_unseen(found: Registration, predicted: Pose, least: float) -> Registration:
    """The same with the position along an unobserved direction as predicted.

    Between two plain walls, noise alone would choose the slide, and momentum would keep it.
    """
    along = _unobserved(found, least)
    if along is None:
        return found
    c, s = math.cos(along), math.sin(along)
    slide = c * (predicted.x - found.pose.x) + s * (predicted.y - found.pose.y)
    pose = Pose(found.pose.x + slide * c, found.pose.y + slide * s, found.pose.theta)
    weak_below = least * observe(found.information).lambda_max
    known = project_out_weak(found.information, weak_below=weak_below)
    return replace(found, pose=pose, information=known)


def _unobserved(found: Registration, least: float) -> float | None:
    """Direction in the map's axes [rad] along which nothing is observed, None if there is none."""
    seen = observe(found.information)
    if seen.lambda_min >= least * seen.lambda_max:
        return None
    xx, xy, yy = seen.translation[0, 0], seen.translation[0, 1], seen.translation[1, 1]
    return 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi


def _in_own_axes(found: Registration) -> NDArray[np.float64]:
    c, s = math.cos(found.pose.theta), math.sin(found.pose.theta)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned: NDArray[np.float64] = R.T @ found.information @ R
    return turned
