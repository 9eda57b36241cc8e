"""What a site knows at one version: the immutable answer behind every query."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.layer import Layer
from lineloom_core.mapping.belief.claim import Claim, Origin
from lineloom_core.mapping.belief.constraint_state import (
    ConstraintKind,
    ConstraintState,
    StateChange,
)
from lineloom_core.mapping.facts.robot_state import RobotState
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_core.mapping.facts.unplaced_scan import UnplacedScan


@storable("robot-view")
@dataclass(frozen=True)
class RobotView:
    """A robot at its latest processed scan.

    pose: of the base (the laser where no mount is set) in the component's map frame, None before
    the first scan could be placed. covariance: 3x3, order x, y, theta, in the map frame.
    """

    robot: str
    component: str | None
    pose: Pose | None
    covariance: NDArray[np.float64] | None
    state: RobotState
    scans_processed: int
    keyframes: int
    latest_stamp: float | None
    latest_session: str | None
    latest_seq: int | None
    health: tuple[str, ...] = ()


@storable("component-view")
@dataclass(frozen=True)
class ComponentView:
    """A set of trajectory pieces whose relative poses are known."""

    id: str
    robots: tuple[str, ...]
    keyframes: int


@dataclass(frozen=True)
class TrajectoryView:
    """Every processed scan of a robot, in processing order; n rows of those that were placed.

    poses: (n, 3) x, y, theta of the base in the map frame of `component[i]`. unplaced: the others.
    """

    session: tuple[str, ...]
    seq: NDArray[np.int64]
    stamp: NDArray[np.float64]
    component: tuple[str, ...]
    poses: NDArray[np.float64]
    unplaced: tuple[UnplacedScan, ...] = ()

    def rows(self) -> Iterator[tuple[str, int, float, str | None, list[float] | None]]:
        """Session, seq, stamp, component and pose of every scan; the last two None if unplaced."""
        waiting = iter(self.unplaced)
        lost = next(waiting, None)
        seq, stamp, poses = self.seq.tolist(), self.stamp.tolist(), self.poses.tolist()
        for i in range(len(seq) + 1):
            while lost is not None and lost.after <= i:
                yield lost.session, lost.seq, lost.stamp, None, None
                lost = next(waiting, None)
            if i < len(seq):
                yield self.session[i], seq[i], stamp[i], self.component[i], poses[i]


@storable("map-line")
@dataclass(frozen=True)
class MapLine:
    """A wall piece seen by one or more scans; the free side lies left of 1 -> 2.

    sigma [m]: one standard deviation of the line's position across itself, against the poses of
    those who saw it (its shape, not its place in the map). support: scans (keyframes) that saw it.
    first_seen / last_seen: stamps on the seeing robots' own clocks. wall: shared by the pieces of
    one wall, which lie on one line; between them are openings.
    """

    id: str
    component: str
    x1: float
    y1: float
    x2: float
    y2: float
    sigma: float
    support: int
    robots: tuple[str, ...]
    first_seen: float
    last_seen: float
    layer: Layer = "wall"
    wall: str = ""


@storable("keyframe-view")
@dataclass(frozen=True)
class KeyframeView:
    """A node of the pose graph: pose of the laser in the component's map frame."""

    id: str
    robot: str
    component: str
    session: str
    seq: int
    stamp: float
    pose: Pose


@storable("place-view")
@dataclass(frozen=True, slots=True)
class PlaceView:
    """The last metres of a robot's way at one time, by which it is recognised (`Place`).

    anchor: the keyframe whose frame is its own. keyframes: all of them, in driving order.
    """

    id: str
    robot: str
    anchor: str
    keyframes: tuple[str, ...]


@storable("constraint-view")
@dataclass(frozen=True)
class ConstraintView:
    """An edge of the pose graph and why it is what it is.

    T_a_b: pose of keyframe b in the frame of keyframe a. information: 3x3 in the tangent space of
    T_a_b at b (order x, y, theta, in the axes of b, as gtsam's BetweenFactorPose2 takes it).
    checks: figure per check, e.g. {"conflict": 0.03, "overlap_m": 11.2}. residual: whitened norm
    in the graph now (None where the constraint is not in the graph). origin, scan_a, scan_b: what
    it rests on, whatever becomes of its keyframes in another replay.
    """

    id: str
    kind: ConstraintKind
    state: ConstraintState
    keyframe_a: str
    keyframe_b: str
    T_a_b: Pose
    information: NDArray[np.float64]
    reason: str
    origin: Origin
    scan_a: ScanName
    scan_b: ScanName
    checks: dict[str, float] = field(default_factory=dict)
    consistency_set: tuple[str, ...] = ()
    residual: float | None = None
    history: tuple[StateChange, ...] = ()

    @property
    def claim(self) -> Claim:
        """What it says, for a verdict that outlives it."""
        return Claim(self.id, self.kind, self.origin, self.scan_a, self.scan_b, self.T_a_b)


@dataclass(frozen=True)
class SiteView:
    """Everything published at one version.

    version: number of log entries processed; grows with every one, so it is the same again after
    a replay. merged_into: component id -> id of the survivor, for components that were absorbed.
    trajectories: by robot, of all robots (put together when asked for, see `trajectories`).
    settled: poses are the optimum of all constraints, and not only within millimetres of it.
    """

    version: int
    robots: dict[str, RobotView]
    components: tuple[ComponentView, ...]
    merged_into: dict[str, str]
    trajectories: Mapping[str, TrajectoryView]
    lines: tuple[MapLine, ...]
    keyframes: tuple[KeyframeView, ...]
    constraints: tuple[ConstraintView, ...]
    places: tuple[PlaceView, ...] = ()
    settled: bool = False

    @property
    def stage(self) -> tuple[int, bool]:
        """What tells it from all others of its site, in the order in which they are shown."""
        return self.version, self.settled
