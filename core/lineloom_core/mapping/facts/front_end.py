"""A robot's scans become keyframes: steps 1 to 4, which no belief about the map enters.

Steps of `take`: 1. bring the scan into counter-clockwise order, undo an inverted mount and what the
sensor doctor knows to be wrong; 2. extract its features; 3. track it against the robot's own last
keyframes, or open a new track, without any link, where nothing fits; 4. a scan that moved on
becomes a keyframe; 5. let the doctor look at it, and distrust the robot where its geometry is
certainly wrong. A scan that comes after its successors is placed against the keyframes around it
and tracks nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lineloom_core.features import ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_core.health import without_skew
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.drift import step_drift
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.facts.information import step_information
from lineloom_core.mapping.facts.keyframe import Keyframe, Step
from lineloom_core.mapping.facts.placed_scans import PlacedScan
from lineloom_core.mapping.facts.robot_record import RobotRecord
from lineloom_core.mapping.facts.sweep_turn import turn_rate_of_sweep
from lineloom_core.mapping.facts.thesis_tracker import ThesisTracker
from lineloom_core.mapping.facts.tracker import Tracked
from lineloom_core.mapping.facts.trackers import new_tracker
from lineloom_core.matching.local_map import Cloud, LocalMap
from lineloom_core.scan import Scan

_AROUND = 4


@dataclass(frozen=True, slots=True)
class Taken:
    """placed: the scan has a pose. keyframe: what was made of it. started: it opened a track.

    distrusted: the robot's keyframes have just lost their trust.
    """

    placed: bool
    keyframe: Keyframe | None = None
    started: bool = False
    distrusted: bool = False


def take(
    config: MapperConfig, history: History, record: RobotRecord, scan: Scan, version: int
) -> Taken:
    """Process a robot's next scan, the log's entry number `version`."""
    record.processed += 1
    is_late = _is_late(record, scan)
    if scan.session != record.session and not is_late:
        record.tracker = None  # restarted: it may have been carried anywhere
        record.sessions[scan.session] = None
        record.trust_again()
    raw = _in_order(config, record, scan, is_late=is_late)
    scan = record.doctor.prepared(raw)
    features = extract_features(scan, config.extraction)
    cloud = Cloud.of(features)
    if is_late:
        return _back_fill(config, history, record, scan, cloud)
    record.session, record.seq, record.stamp = scan.session, scan.seq, scan.stamp
    tracked = _track(config, record, scan, features, cloud) if len(features.points) else None
    if tracked is None or tracked.pose is None:
        taken = _unplaced(record, scan)
    else:
        taken = _place(config, history, record, scan, tracked, version)
    record.doctor.examine(raw, features, tracked.pose if tracked else None, record.track)
    if record.state == "tracking" and not record.doctor.follows:
        record.state = "lost"
    return _distrust(history, record, taken)


def _in_order(config: MapperConfig, record: RobotRecord, scan: Scan, *, is_late: bool) -> Scan:
    """Step 1: without the skew of turning, where beams are timed, and counter-clockwise.

    Ranges count to a micrometre: last bits depend on who computed them, and would tell where a
    line is split or a point falls.
    """
    ranges = np.round(scan.ranges, 6)
    ranges.setflags(write=False)  # as every scan's: kernels are compiled for either kind
    scan = replace(scan, ranges=ranges)
    inverted = record.mount.inverted
    if not is_late:
        timed = record.doctor.timed(scan)
        rate = _turn_rate(config, record, timed)
        still = without_skew(timed, rate, inverted=inverted)
        scan = replace(still, time_increment=scan.time_increment)  # for the doctor, as it came
    return scan.counter_clockwise(inverted=inverted)


def _turn_rate(config: MapperConfig, record: RobotRecord, timed: Scan) -> float:
    """How fast the robot turns during a sweep [rad/s]; 0 where beams are not timed."""
    if not timed.time_increment:
        return 0.0
    tracker, inverted = record.tracker, record.mount.inverted
    if isinstance(tracker, ThesisTracker):
        return tracker.turn_rate
    return turn_rate_of_sweep(tracker, timed, config.extraction, inverted=inverted)


def _distrust(history: History, record: RobotRecord, taken: Taken) -> Taken:
    """Step 5: once an error is found, nothing of the robot's session is to be believed."""
    if taken.keyframe is None or record.distrusted:
        return taken
    errors = [f.name for f in record.doctor.findings() if f.severity == "error"]
    if not errors:
        return taken
    record.distrusted = errors[0]
    history.distrust(record.name, taken.keyframe.scan.session)
    return replace(taken, keyframe=history[taken.keyframe.id], distrusted=True)


def _is_late(record: RobotRecord, scan: Scan) -> bool:
    """Whether newer scans have been processed already, of its session or of a younger one."""
    if scan.session != record.session:
        return scan.session in record.sessions
    return record.seq is not None and scan.seq < record.seq


def _track(
    config: MapperConfig, record: RobotRecord, scan: Scan, features: ScanFeatures, cloud: Cloud
) -> Tracked:
    """Step 3: the robot's track goes on, or a new one begins without any link to the old."""
    if record.tracker is None:
        _begin_track(config, record)
    assert record.tracker is not None
    odometry = _laser_odometry(record, scan)
    tracked = record.tracker.track(features, cloud, scan.stamp, odometry)
    if tracked.status == "lost":
        _begin_track(config, record)
        tracked = record.tracker.track(features, cloud, scan.stamp, odometry)
    return tracked


def _begin_track(config: MapperConfig, record: RobotRecord) -> None:
    record.tracker, record.track, record.last_keyframe = new_tracker(config), None, None


def _laser_odometry(record: RobotRecord, scan: Scan) -> Pose | None:
    if scan.odometry is None:
        return None
    return scan.odometry @ record.mount.T_base_laser


def _unplaced(record: RobotRecord, scan: Scan) -> Taken:
    """The latest scan has no pose: say so, until one has."""
    record.leave_unplaced(scan)
    if len(record.placed):
        record.state = "lost"
    return Taken(placed=False)


def _place(
    config: MapperConfig,
    history: History,
    record: RobotRecord,
    scan: Scan,
    tracked: Tracked,
    version: int,
) -> Taken:
    """Step 4: keep the scan as a keyframe, or remember it by the last one."""
    assert tracked.pose is not None
    started = record.track is None
    if record.track is None:
        record.track = history.new_track()
    if not tracked.is_keyframe and record.last_keyframe is not None:
        last = history[record.last_keyframe]
        _remember(record, scan, last.id, last.T_track_laser.between(tracked.pose))
        return Taken(placed=True)
    keyframe = Keyframe(
        id=history.new_keyframe(),
        robot=record.name,
        track=record.track,
        scan=scan,
        T_track_laser=tracked.pose,
        step=_step(history, record, tracked),
        version=version,
        extraction=config.extraction,
        trusted=not record.distrusted,
        repeat=record.name_next(scan).repeat,
    )
    history.add(keyframe)
    record.last_keyframe = keyframe.id
    _remember(record, scan, keyframe.id, Pose.identity())
    return Taken(placed=True, keyframe=keyframe, started=started)


def _step(history: History, record: RobotRecord, tracked: Tracked) -> Step | None:
    if record.last_keyframe is None:
        return None
    assert tracked.pose is not None
    last = history[record.last_keyframe]
    return Step(
        previous=last.id,
        T_previous_this=last.T_track_laser.between(tracked.pose),
        information=step_information(np.asarray(tracked.information), tracked.unseen),
        drift=step_drift(tracked.information, tracked.noise, tracked.unseen),
        checks=tracked.checks,
    )


def _remember(record: RobotRecord, scan: Scan, keyframe: int, T: Pose) -> None:
    record.state = "tracking"
    record.latest = PlacedScan(scan.session, scan.seq, scan.stamp, keyframe, T)
    record.placed.append(record.latest)


def _back_fill(
    config: MapperConfig, history: History, record: RobotRecord, scan: Scan, cloud: Cloud
) -> Taken:
    """Place a late scan against the keyframes around its sequence number; track nothing."""
    anchor = history.nearest(record.name, scan.session, scan.seq)
    if anchor is not None and len(cloud.points):
        surroundings = LocalMap.build(
            (f.cloud, anchor.T_track_laser.between(f.T_track_laser))
            for f in history.around(anchor, _AROUND)
        )
        guess, _ = surroundings.search(cloud, Pose.identity(), reach_xy=0.7, reach_theta=0.5)
        found = surroundings.register(cloud, guess)
        if found.fit >= config.least_fit_late:
            record.placed.append(
                PlacedScan(scan.session, scan.seq, scan.stamp, anchor.id, found.pose)
            )
            return Taken(placed=True)
    record.leave_unplaced(scan)
    return Taken(placed=False)
