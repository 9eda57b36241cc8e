"""One site's map as a deterministic state machine over its log of scans and operator actions.

Steps of `SiteMapper.add`, for every scan of any robot:
 1. bring the scan into counter-clockwise order, undo an inverted mount;
 2. extract its features (chapter 3);
 3. track it against the robot's local map, or open a new track where nothing fits;
 4. a scan that moved on becomes a keyframe: a node and a sequential constraint;
 5. close loops with older keyframes that the graph says are near;
 6. every few metres, make a place of the last keyframes and look for it among all others;
 7. believe sets of candidates that agree, join components, optimise.

No clock, no randomness, no I/O: the same log gives the same bits, also across `snapshot` and
`restore`. Everything shown is a function of that state (`view`).
"""

from __future__ import annotations

import pickle

import numpy as np

from lineloom_core.features import ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_core.mapping.candidates import consider
from lineloom_core.mapping.changes import Changes, ComponentMerged
from lineloom_core.mapping.closing import close_nearby
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.constraint import Constraint, step_information
from lineloom_core.mapping.keyframe import Keyframe
from lineloom_core.mapping.place_making import make_place, place_is_due, recent_keyframes
from lineloom_core.mapping.robot_record import PlacedScan, RobotRecord, Track
from lineloom_core.mapping.site_map import SiteMap
from lineloom_core.mapping.site_view import SiteView
from lineloom_core.mapping.tracker import Tracked, Tracker
from lineloom_core.mapping.view_builder import build_view
from lineloom_core.matching.local_map import Cloud, LocalMap
from lineloom_core.scan import Mount, Scan

SNAPSHOT_FORMAT = 3
_CLOSURES_UNSOLVED = 6


class SnapshotError(ValueError):
    """A snapshot that this version cannot read: rebuild from the log instead."""


class SiteMapper:
    """The mapper of one site. Not thread safe; one process owns it."""

    def __init__(self, config: MapperConfig | None = None) -> None:
        self._config = config or MapperConfig()
        self._site = SiteMap(self._config)
        self._robots: dict[str, RobotRecord] = {}
        self._version = 0
        self._unsolved: dict[int, int] = {}
        """By component root: closures accepted since it was last solved."""

    @property
    def version(self) -> int:
        """Number of log entries processed."""
        return self._version

    def add(self, robot: str, scan: Scan) -> Changes:
        """Process the next scan of a robot; raises nothing for a scan that `Scan.checked` made."""
        self._version += 1
        record = self._robots.setdefault(robot, RobotRecord(robot))
        record.processed += 1
        scan = scan.counter_clockwise(inverted=record.mount.inverted)
        features = extract_features(scan, self._config.extraction)
        cloud = Cloud.of(features)
        if _is_late(record, scan):
            return self._back_fill(record, scan, cloud)
        if scan.session != record.session:
            record.tracker = None  # restarted: it may have been carried anywhere
            record.sessions[scan.session] = None
        record.session, record.seq, record.stamp = scan.session, scan.seq, scan.stamp
        tracked = self._track(record, scan, features, cloud) if len(features.points) else None
        if tracked is None or tracked.pose is None:
            return _unplaced(record)
        return self._place(record, scan, tracked)

    def set_mount(self, robot: str, mount: Mount) -> None:
        """Set where a robot's lidar sits; `inverted` counts for the scans that follow."""
        self._version += 1
        record = self._robots.setdefault(robot, RobotRecord(robot))
        if record.mount.inverted != mount.inverted:
            record.tracker = None
        record.mount = mount

    def forget(self, robot: str) -> None:
        """Drop a robot with everything that rests on its scans."""
        self._version += 1
        if self._robots.pop(robot, None) is not None:
            self._site.forget(robot)

    def view(self) -> SiteView:
        """Everything there is to know at this version; changes nothing."""
        return build_view(self._site, self._robots, self._version)

    def snapshot(self) -> bytes:
        """The whole state as bytes, for `restore`."""
        state = (
            SNAPSHOT_FORMAT,
            self._config,
            self._site,
            self._robots,
            self._version,
            self._unsolved,
        )
        return pickle.dumps(state, protocol=5)

    @classmethod
    def restore(cls, data: bytes) -> SiteMapper:
        """Go on from a snapshot. Raises SnapshotError where it cannot be read."""
        try:
            form, config, site, robots, version, unsolved = pickle.loads(data)
        except Exception as error:
            raise SnapshotError(f"unreadable snapshot: {error}") from error
        if form != SNAPSHOT_FORMAT:
            raise SnapshotError(f"snapshot of format {form}, expected {SNAPSHOT_FORMAT}")
        mapper = cls(config)
        mapper._site, mapper._robots, mapper._version = site, robots, version
        mapper._unsolved = unsolved
        return mapper

    def _track(
        self, record: RobotRecord, scan: Scan, features: ScanFeatures, cloud: Cloud
    ) -> Tracked:
        """Step 3: the robot's track goes on, or a new one begins without any link to the old."""
        if record.tracker is None:
            record.tracker, record.track = Tracker(self._config.tracker), None
        odometry = _laser_odometry(record, scan)
        tracked = record.tracker.track(features, cloud, scan.stamp, odometry)
        if tracked.status == "lost":
            record.tracker, record.track = Tracker(self._config.tracker), None
            tracked = record.tracker.track(features, cloud, scan.stamp, odometry)
        return tracked

    def _place(self, record: RobotRecord, scan: Scan, tracked: Tracked) -> Changes:
        """Steps 4 to 7 for a scan that the tracker placed."""
        assert tracked.pose is not None
        started = None
        if record.track is None:
            record.track = Track(self._site.number("track"), record.name)
            self._site.tracks[record.track.id] = record.track
            started = f"c{record.track.id}"
        if not tracked.is_keyframe:
            last = self._site.keyframes[record.track.keyframes[-1]]
            self._remember(record, scan, last.id, last.T_track_laser.between(tracked.pose))
            return Changes(placed=True)
        keyframe = self._add_keyframe(record.track, scan, tracked)
        self._remember(record, scan, keyframe.id, Pose.identity())
        optimised = self._close_loops(record.track, keyframe.id)
        merges, moved = self._recognise(record.track)
        return Changes(
            placed=True,
            started_component=started,
            keyframe=keyframe.id,
            merges=tuple(merges),
            optimised=optimised or moved,
        )

    def _remember(self, record: RobotRecord, scan: Scan, keyframe: int, T: Pose) -> None:
        record.state = "tracking"
        record.latest = PlacedScan(scan.session, scan.seq, scan.stamp, keyframe, T)
        record.placed.append(record.latest)

    def _add_keyframe(self, track: Track, scan: Scan, tracked: Tracked) -> Keyframe:
        assert tracked.pose is not None
        site = self._site
        keyframe = Keyframe(
            id=site.number("keyframe"),
            robot=track.robot,
            track=track.id,
            scan=scan,
            T_track_laser=tracked.pose,
            extraction=self._config.extraction,
        )
        site.keyframes[keyframe.id] = keyframe
        if not track.keyframes:
            site.add_node(keyframe.id, Pose.identity())
            track.travelled.append(0.0)
        else:
            last = site.keyframes[track.keyframes[-1]]
            T_last_new = last.T_track_laser.between(tracked.pose)
            site.add_node(keyframe.id, site.pose(last.id) @ T_last_new)
            track.travelled.append(track.travelled[-1] + last.T_track_laser.distance(tracked.pose))
            site.add_constraint(_step(site.new_constraint_id(), last, keyframe, tracked))
        track.keyframes.append(keyframe.id)
        return keyframe

    def _close_loops(self, track: Track, keyframe: int) -> bool:
        if len(track.keyframes) % self._config.closure.every:
            return False
        closed = close_nearby(self._site, keyframe)
        if closed is None:
            return False
        root = self._site.component_root(keyframe)
        waiting = self._unsolved.pop(root, 0) + 1
        step = closed.checks["moved_m"] + 2.0 * closed.checks["turned_rad"]
        if step < 0.05 and waiting < _CLOSURES_UNSOLVED:
            self._unsolved[root] = waiting
            return False  # says what the graph knew: it can wait for the next that does not
        self._site.optimise(keyframe)
        return True

    def _recognise(self, track: Track) -> tuple[list[ComponentMerged], bool]:
        """Make a place when the robot has driven on far enough, and look for it elsewhere."""
        config = self._config.places
        if not place_is_due(track, config):
            return [], False
        track.last_place_at = track.travelled[-1]
        members = recent_keyframes(track, config)
        if len(members) < config.least_keyframes:
            return [], False
        place = make_place(self._site.number("place"), members, self._site.keyframes)
        self._site.places[place.id] = place
        merges, moved = consider(self._site, place)
        for merge in merges:
            self._tie_after(merge)
        return merges, moved

    def _tie_after(self, merge: ComponentMerged) -> None:
        """After a merge, tie the two parts wherever they run near each other."""
        site = self._site
        closed = False
        for keyframe in sorted(site.keyframes):
            if site.component_id(keyframe) == merge.survivor and keyframe % 2 == 0:
                closed = close_nearby(site, keyframe) is not None or closed
        if closed:
            site.optimise(site.keyframes[_first_keyframe(site, merge.survivor)].id)

    def _back_fill(self, record: RobotRecord, scan: Scan, cloud: Cloud) -> Changes:
        """Place a late scan against the keyframes around its sequence number; track nothing."""
        near = [
            k
            for k in self._site.keyframes.values()
            if k.robot == record.name and k.scan.session == scan.session
        ]
        if near and len(cloud.points):
            anchor = min(near, key=lambda k: (abs(k.scan.seq - scan.seq), k.id))
            around = self._site.neighbours_on_track(anchor.id, 4)
            frames = [self._site.keyframes[k] for k in around]
            surroundings = LocalMap.build(
                (f.cloud, anchor.T_track_laser.between(f.T_track_laser)) for f in frames
            )
            guess, _ = surroundings.search(cloud, Pose.identity(), reach_xy=0.7, reach_theta=0.5)
            found = surroundings.register(cloud, guess)
            if found.fit >= self._config.least_fit_late:
                record.placed.append(
                    PlacedScan(scan.session, scan.seq, scan.stamp, anchor.id, found.pose)
                )
                return Changes(placed=True)
        record.unplaced += 1
        return Changes(placed=False)


def _unplaced(record: RobotRecord) -> Changes:
    """The latest scan has no pose: say so, until one has."""
    record.unplaced += 1
    if record.placed:
        record.state = "lost"
    return Changes(placed=False)


def _is_late(record: RobotRecord, scan: Scan) -> bool:
    """Whether newer scans have been processed already, of its session or of a younger one."""
    if scan.session != record.session:
        return scan.session in record.sessions
    return record.seq is not None and scan.seq < record.seq


def _laser_odometry(record: RobotRecord, scan: Scan) -> Pose | None:
    if scan.odometry is None:
        return None
    return scan.odometry @ record.mount.T_base_laser


def _step(constraint_id: str, last: Keyframe, new: Keyframe, tracked: Tracked) -> Constraint:
    return Constraint(
        id=constraint_id,
        kind="sequential",
        state="accepted",
        keyframe_a=last.id,
        keyframe_b=new.id,
        T_a_b=last.T_track_laser.between(new.T_track_laser),
        information=step_information(np.asarray(tracked.information), (0.15, 0.05)),
        reason="tracked from scan to scan",
        checks={"fit": tracked.fit, "conflict_share": tracked.conflict},
    )


def _first_keyframe(site: SiteMap, component: str) -> int:
    return site.tracks[int(component[1:])].keyframes[0]
