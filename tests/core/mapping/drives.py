"""Drives, faults and yardsticks that the mapper's tests share; everything is seeded."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.changes import Changes
from lineloom_core.mapping.facts.tracker import Tracked
from lineloom_core.mapping.facts.trackers import AnyTracker
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.matching.local_map import Cloud
from lineloom_core.scan import Mount, Scan
from lineloom_lab.evaluation import TrajectoryError, trajectory_error
from lineloom_lab.simulation import (
    Drive,
    Leg,
    Lidar,
    SimulatedRobot,
    SimulatedScan,
    World,
    sick_lms200,
)
from numpy.typing import NDArray


def legs(start: Pose, *steps: tuple[float, float], speed: float = 0.5, rate: float = 0.6) -> Drive:
    """A drive of (length [m], turn [rad]) steps, collisions not looked at."""
    driven: list[Leg] = []
    here = start
    for length, turn in steps:
        driven.append(Leg(here, length, turn, max(length / speed, abs(turn) / rate)))
        here = driven[-1].end
    return Drive(start, tuple(driven))


def scans_of(
    world: World,
    drive: Drive,
    *,
    name: str = "r",
    seed: int = 0,
    lidar: Lidar | None = None,
    mount: Mount | None = None,
) -> list[SimulatedScan]:
    """What a robot on that drive measures."""
    robot = SimulatedRobot(name, world, lidar or sick_lms200(), drive, seed, mount=mount or Mount())
    return list(robot.scans())


def covered(scan: Scan, distance: float = 0.3) -> Scan:
    """The same scan with somebody right before the lidar: every beam ends close by."""
    n = len(scan)
    ranges = distance + 0.05 * np.sin(np.linspace(0.0, 9.0 * math.pi, n))
    return replace(scan, ranges=ranges)


def empty(scan: Scan) -> Scan:
    """The same scan with nothing but no-returns."""
    return replace(scan, ranges=np.full(len(scan), np.inf))


def track(tracker: AnyTracker, scan: Scan, stamp: float | None = None) -> Tracked:
    """Give a scan to the tracker as the mapper does, with its odometry if it has any."""
    features = extract_features(scan)
    at = scan.stamp if stamp is None else stamp
    return tracker.track(features, Cloud.of(features), at, scan.odometry)


def track_errors(scans: Sequence[SimulatedScan], tracked: Sequence[Tracked]) -> NDArray[np.float64]:
    """Error (m, rad) of each placed scan, in the frame of the first one; shape (n, 2)."""
    origin = scans[0].true_pose
    rows = []
    for simulated, found in zip(scans, tracked, strict=True):
        if found.pose is not None:
            off = origin.between(simulated.true_pose).between(found.pose)
            rows.append((math.hypot(off.x, off.y), abs(off.theta)))
    return np.array(rows)


def feed(mapper: SiteMapper, scans: Iterable[SimulatedScan]) -> list[Changes]:
    """Add scans in their order."""
    return [mapper.add(s.robot, s.scan) for s in scans]


def mapped(scans: Iterable[SimulatedScan]) -> SiteMapper:
    """A new mapper that has processed the scans."""
    mapper = SiteMapper()
    feed(mapper, scans)
    return mapper


def component_error(
    view: SiteView, scans: Sequence[SimulatedScan], component: str | None = None
) -> TrajectoryError:
    """Error of all trajectories in a component against the truth, one rigid motion aside.

    component: the oldest if None.
    Robots with wrong relative poses cannot hide in it: all are aligned together.
    """
    truth = {(s.robot, s.scan.session, s.scan.seq): s.true_pose.to_array() for s in scans}
    component = component or view.components[0].id
    estimate, true = [], []
    for robot, trajectory in view.trajectories.items():
        for i in range(len(trajectory.seq)):
            if trajectory.component[i] == component:
                estimate.append(trajectory.poses[i])
                true.append(truth[robot, trajectory.session[i], int(trajectory.seq[i])])
    return trajectory_error(np.array(estimate), np.array(true))


def fingerprint(view: SiteView) -> tuple[object, ...]:
    """Everything in a view as plain values that compare bit for bit."""
    return (
        view.version,
        view.components,
        tuple(view.merged_into.items()),
        view.lines,
        view.keyframes,
        tuple(
            (
                *(c.id, c.kind, c.state, c.keyframe_a, c.keyframe_b, c.T_a_b, c.reason),
                *(c.information.tobytes(), tuple(c.checks.items()), c.consistency_set, c.residual),
            )
            for c in view.constraints
        ),
        tuple(
            (name, t.session, t.seq.tobytes(), t.stamp.tobytes(), t.component, t.poses.tobytes())
            for name, t in view.trajectories.items()
        ),
        tuple(replace(r, covariance=None) for r in view.robots.values()),
        tuple(
            None if r.covariance is None else r.covariance.tobytes() for r in view.robots.values()
        ),
    )
