"""What stood still among a track's last keyframes, and that nothing else tells the way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.mapping.config import TrackerConfig
from lineloom_core.mapping.facts.recent import Recent
from lineloom_core.mapping.facts.tracker import Tracker
from lineloom_core.matching.local_map import Cloud
from lineloom_lab.simulation import (
    Drive,
    Leg,
    Lidar,
    SimulatedRobot,
    SimulatedScan,
    Walkers,
    World,
    long_corridor,
    rectangle,
    scanner_360,
    sick_lms200,
)

from tests.core.mapping.drives import legs, track, track_errors
from tests.core.mapping.sites import thinned

SEES_FAR = Lidar(
    -0.75 * math.pi, math.radians(1.0), 271, range_min=0.06, range_max=30.0, range_sigma=0.01,
    range_clip=0.03, rate_hz=5.0,
)  # fmt: skip


def robot(world: World, drive: Drive, person: Drive | None, lidar: Lidar) -> SimulatedRobot:
    blockers = (Walkers((person,), 0.25),) if person else ()
    return SimulatedRobot("r", world, lidar, drive, seed=3, blockers=blockers)


def remembered(scans: list[SimulatedScan], most: int = 8) -> Recent:
    """A keyframe every 0.4 m, where it truly was."""
    recent = Recent(most, most)
    for s in thinned(scans, 0.4):
        features = extract_features(s.scan)
        pose = scans[0].true_pose.between(s.true_pose)
        recent.add(features, Cloud.of(features), pose, depth=most)
    return recent


def near(surface: np.ndarray, x: float, y: float, radius: float = 0.5) -> int:
    return int(np.count_nonzero(np.hypot(surface[:, 0] - x, surface[:, 1] - y) < radius))


def test_walls_stand_still_and_a_walker_does_not() -> None:
    world = rectangle(12.0, 6.0)
    drive = legs(Pose(2.0, 2.0, 0.0), (3.0, 0.0))
    person = legs(Pose(4.0, 2.0, 0.0), (3.0, 0.0))
    scans = list(robot(world, drive, person, scanner_360()).scans())
    recent = remembered(scans)
    last = thinned(scans, 0.4)[-1]
    here = person.pose_at(last.time_s)
    x, y = scans[0].true_pose.inverse().transform(np.array([[here.x, here.y]]))[0]
    assert near(recent.map.surface, x, y) > 3
    assert near(recent.steady.surface, x, y) == 0
    assert len(recent.steady.surface) > 0.8 * len(recent.map.surface)


def test_of_a_single_keyframe_nothing_is_known_to_stand_still() -> None:
    scans = list(
        robot(rectangle(8.0, 5.0), legs(Pose(2, 2, 0), (0.2, 0.0)), None, SEES_FAR).scans()
    )
    assert len(remembered(scans[:1]).steady.surface) == 0


def test_a_stored_memory_has_the_same_maps() -> None:
    scans = list(
        robot(rectangle(8.0, 5.0), legs(Pose(2, 2, 0), (2.0, 0.0)), None, SEES_FAR).scans()
    )
    recent = remembered(scans)
    again = decode(encode(recent), Recent)
    for a, b in ((recent.map, again.map), (recent.steady, again.steady)):
        assert a.surface.tobytes() == b.surface.tobytes()


def walk(start: Pose, *parts: tuple[float, float]) -> Drive:
    """Straight on, in (length [m], speed [m/s]) parts."""
    driven: list[Leg] = []
    for length, speed in parts:
        begin = driven[-1].end if driven else start
        driven += legs(begin, (length, 0.0), speed=speed).legs
    return Drive(start, tuple(driven))


@pytest.mark.parametrize(
    "person",
    [
        walk(Pose(3.0, 1.55, 0.0), (8.0, 1.0), (15.0, 0.5)),
        walk(Pose(1.0, 1.55, 0.0), (28.0, 1.0)),
        walk(Pose(35.0, 1.55, math.pi), (30.0, 1.0)),
    ],
    ids=["in company", "overtaken", "towards"],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_nobody_who_walks_a_corridor_drags_the_robot_along(person: Drive, seed: int) -> None:
    """Somebody taken for a piece of wall makes the robot seem to stand or to run, for metres."""
    drive = legs(Pose(6.0, 0.7, 0.0), (16.0, 0.0))
    scans = list(replace(robot(long_corridor(), drive, person, SEES_FAR), seed=seed).scans())
    tracker = Tracker()
    found = [track(tracker, s.scan) for s in scans]
    errors = track_errors(scans, found)
    assert len(errors) == len(scans)
    assert errors[:, 0].max() < 0.25


@pytest.mark.parametrize("lidar", [SEES_FAR, sick_lms200()], ids=["270", "sick"])
def test_after_lost_scans_a_robot_is_found_where_it_drove_or_not_at_all(lidar: Lidar) -> None:
    drive = legs(Pose(4.0, 1.0, 0.0), (20.0, 0.0), (0.0, 2.0), (0.5, 0.0), (0.0, -2.0), (10.0, 0.0))
    scans = list(robot(long_corridor(), drive, None, lidar).scans())
    tracker, kept, found = Tracker(), [], []
    for s in scans:
        if s.scan.seq % 40 < 30:  # two seconds in eight are missing
            kept.append(s)
            found.append(track(tracker, s.scan))
    errors = track_errors(kept, found)
    assert errors[:, 0].max() < 0.3
    assert sum(f.status == "tracked" for f in found) > 0.9 * len(found)


def test_after_a_long_silence_no_scan_is_linked_however_well_it_fits() -> None:
    scans = list(
        robot(rectangle(8.0, 5.0), legs(Pose(2, 2, 0), (2.0, 0.0)), None, SEES_FAR).scans()
    )
    silence = TrackerConfig().longest_silence / SEES_FAR.rate_hz
    for wait, status in ((0.5 * silence, "tracked"), (silence + 1.0, "lost")):
        tracker = Tracker()
        for s in scans:
            track(tracker, s.scan)
        late = replace(scans[-1].scan, stamp=scans[-1].scan.stamp + wait)
        assert track(tracker, late).status == status
