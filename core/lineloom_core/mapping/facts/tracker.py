"""Following one robot from scan to scan, without odometry.

Steps of `Tracker.track`:
 1. predict the pose from the velocity of the last step, after a gap from that of the last second
    (and from odometry that is believed);
 2. search a window around each prediction against the local map, wider the longer the gap;
 3. register the best by points and normals against what stood still (`recent`): people walk;
 4. along the direction that is known least, weigh the prediction in by what is known;
 5. check: enough of the scan must lie on known surfaces, and hardly any of it where the keyframe
    saw free space; after a gap, more and less of it;
 6. where nothing fits, say so. A few such scans are skipped (somebody stood before the lidar);
    then the track is lost and a new one begins without any link, as it does after a long silence.

Departs from the design's line tracker: registration against averaged points of the last
keyframes needs no special case for scans without lines. Without loops MIT CSAIL comes out within
0.2 to 0.6 m after 290 m; what loops leave of that is the graph's business.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.checks import TRACKED
from lineloom_core.codec import storable
from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.graph import Observability, observe, project_out_weak
from lineloom_core.mapping.config import TrackerConfig
from lineloom_core.mapping.facts.drift import MEASURED_SHORT, NoiseFigure
from lineloom_core.mapping.facts.recent import Recent
from lineloom_core.mapping.facts.wheels import Wheels
from lineloom_core.matching.free_space import judge_sweeps
from lineloom_core.matching.local_map import Cloud, Registration
from lineloom_core.timing import timed

_SMOOTHING_S = 0.3
_SETTLED = 0.12  # m: the gate with which a registration ends

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


@storable(
    "tracker",
    _config=TrackerConfig,
    _recent=Recent,
    _pose=Pose,
    _twist=NDArray[np.float64],
    _twist_span=float,
    _turn_rate=float,
    _stamp=float,
    _odometry=Pose | None,
    _way=deque[tuple[float, Pose]],
    _misses=int,
    _noise=NoiseFigure,
    _wheels=Wheels,
)
class Tracker:
    """The state of one track: a local map, the last pose and the last velocity."""

    def __init__(self, config: TrackerConfig | None = None) -> None:
        self._config = config or TrackerConfig()
        self._recent = Recent(self._config.memory, self._config.noisy_memory)
        self._pose = Pose.identity()
        self._twist = np.zeros(3)  # m/s, m/s, rad/s in the laser's axes
        self._twist_span = 0.0  # s over which it was measured
        self._turn_rate = 0.0
        self._stamp = 0.0
        self._odometry: Pose | None = None
        self._way: deque[tuple[float, Pose]] = deque()  # of the last second: stamps and poses
        self._misses = 0
        self._noise = NoiseFigure()
        self._wheels = Wheels()

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
        if not len(self._recent):
            self._accept(Pose.identity(), stamp, odometry)
            self._add_keyframe(features, cloud)
            return Tracked("first", self._pose, True, np.zeros((3, 3)))
        if stamp - self._stamp > self._config.longest_silence:
            return _nowhere("lost")
        rolled = self._rolled(stamp, odometry)
        trusted = rolled is not None and self._wheels.believed
        predictions = self._predict(stamp, rolled if trusted else None)
        found = self._register(cloud, predictions, stamp - self._stamp)
        unseen = self._unseen(found)
        if rolled is not None:
            self._wheels.compare(rolled, self._pose.between(found.pose), unseen)
        # Wheels know the way along a plain corridor; elsewhere velocity has less of a bias.
        due = predictions[-1] if not trusted or unseen is not None else predictions[-2]
        found = _without_last_bits(self._held(found, due, stamp - self._stamp))
        checks = {
            "fit": found.fit,
            "conflict_share": self._conflict(features, found.pose),
            "gap_s": stamp - self._stamp,
            "noise": self._noise.value,
        }
        if TRACKED.against(self._config, checks):
            self._misses += 1
            status: Status = "lost" if self._misses >= self._config.patience else "skipped"
            return _nowhere(status, checks)
        self._misses = 0
        self._accept(found.pose, stamp, odometry)
        moved_on = self._moved_on(found, checks["conflict_share"])
        if moved_on:
            self._measure_noise(cloud, found.pose)
            self._add_keyframe(features, cloud)
        information = _in_own_axes(found)
        return Tracked("tracked", found.pose, moved_on, information, checks, self._noise.value)

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

    def _usual_twist(self) -> NDArray[np.float64]:
        """Velocity over the last second, zero where it is not known."""
        (then, before), (now, pose) = self._way[0], self._way[-1]
        if now - then < _SMOOTHING_S:
            return np.zeros(3)
        twist: NDArray[np.float64] = before.between(pose).to_array() / (now - then)
        return twist

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
        elapsed = max(stamp - self._stamp, 0.0)
        # Where scans arrive in bursts, stamps lie: two steps at most, whatever the clock says.
        dt = min(elapsed, self._config.longest_gap, 2.0 * self._twist_span)
        predictions = [self._pose @ Pose.from_array(self._twist * dt)]
        if elapsed > self._config.longest_gap:
            predictions.append(self._pose @ Pose.from_array(self._usual_twist() * elapsed))
        if rolled is not None:
            predictions.append(self._pose @ rolled)
        return predictions

    def _register(self, cloud: Cloud, predictions: list[Pose], dt: float) -> Registration:
        """Register the best find around any prediction; sure of no more than what stood still."""
        gap = min(max(dt, 0.2), 1.5)
        best: tuple[Pose, float] | None = None
        for guess in predictions:
            pose, score = self._recent.map.search(
                cloud, guess, reach_xy=0.2 + 0.4 * gap, reach_theta=0.1 + 0.6 * gap
            )
            # Odometry must fit clearly better than constant velocity to be believed.
            if best is None or score > best[1] + 0.02:
                best = pose, score
        assert best is not None
        hold = 1.0 / self._config.prior_sigma**2
        prior = (hold, hold, hold)
        found = self._recent.map.register(cloud, best[0], prior=prior)
        steady = self._recent.steady.register(cloud, best[0], prior=prior)
        if steady.matched < self._config.steady_share * found.matched:
            return found  # all is new here
        placed = self._recent.map.register(cloud, steady.pose, gate=_SETTLED, iterations=0)
        return replace(placed, information=steady.information)

    def _held(self, found: Registration, predicted: Pose, dt: float) -> Registration:
        """The same, along the direction that is known least as near the prediction as is due.

        Between two plain walls, noise alone would choose the slide, and momentum would keep it.
        """
        seen = observe(found.information)
        c, s = _weakest(seen)
        sigma = self._config.prior_sigma * max(1.0, dt / 0.2)
        known = seen.lambda_min / (MEASURED_SHORT * max(self._noise.value, 1e-3))
        share = 1.0 / (1.0 + known * sigma**2)
        slide = share * (c * (predicted.x - found.pose.x) + s * (predicted.y - found.pose.y))
        pose = Pose(found.pose.x + slide * c, found.pose.y + slide * s, found.pose.theta)
        weak_below = self._config.least_isotropy * seen.lambda_max
        known_of = project_out_weak(found.information, weak_below=weak_below)
        return replace(found, pose=pose, information=known_of)

    def _conflict(self, features: ScanFeatures, pose: Pose) -> float:
        keyframe, at = self._recent.latest
        return judge_sweeps(keyframe, features, at.between(pose)).conflict_share

    def _measure_noise(self, cloud: Cloud, pose: Pose) -> None:
        disagreement = self._recent.map.disagreement(cloud, pose)
        if disagreement is not None:
            self._noise.add(disagreement)

    def _accept(self, pose: Pose, stamp: float, odometry: Pose | None) -> None:
        dt = stamp - self._stamp
        if 0.01 < dt < 1.0:  # steps of zero or less occur in real logs
            self._twist = self._pose.between(pose).to_array() / dt
            self._twist_span = dt
            share = dt / (dt + _SMOOTHING_S)
            self._turn_rate += share * (float(self._twist[2]) - self._turn_rate)
        elif dt >= 1.0:
            self._twist, self._turn_rate = np.zeros(3), 0.0
        self._pose, self._stamp, self._odometry = pose, stamp, odometry
        if self._way and not 0.0 <= stamp - self._way[-1][0] < 1.0:
            self._way.clear()
        self._way.append((stamp, pose))
        while stamp - self._way[0][0] > 1.0:
            self._way.popleft()

    def _add_keyframe(self, features: ScanFeatures, cloud: Cloud) -> None:
        """More keyframes in the local map where a noisy lidar makes each worth less."""
        config = self._config
        depth = config.noisy_memory if self._is_noisy else config.memory
        self._recent.add(features, cloud, self._pose, depth=depth)


def _nowhere(status: Status, checks: dict[str, float] | None = None) -> Tracked:
    return Tracked(status, None, False, np.zeros((3, 3)), checks or {})


def _without_last_bits(found: Registration) -> Registration:
    """The same, its pose to a micrometre and a tenth of a microradian.

    Processors differ in the last bits, and tracking would amplify that to centimetres within
    minutes: a point falls into another cell, a scan becomes a keyframe sooner.
    """
    x, y, theta = found.pose.x, found.pose.y, found.pose.theta
    return replace(found, pose=Pose(round(x, 6), round(y, 6), round(theta, 7)))


def _unobserved(found: Registration, least: float) -> float | None:
    """Direction in the map's axes [rad] along which nothing is observed, None if there is none."""
    seen = observe(found.information)
    if seen.lambda_min >= least * seen.lambda_max:
        return None
    x, y = _weakest(seen)
    return math.atan2(y, x)


def _weakest(seen: Observability) -> tuple[float, float]:
    """Unit vector along which least is known."""
    x, y = np.linalg.eigh(seen.translation)[1][:, 0].tolist()
    return x, y


def _in_own_axes(found: Registration) -> NDArray[np.float64]:
    c, s = math.cos(found.pose.theta), math.sin(found.pose.theta)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned: NDArray[np.float64] = R.T @ found.information @ R
    return turned
