"""A map on the thesis's matcher alone: what it says is right, and what it cannot know, it says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.geometry import Pose
from lineloom_core.mapping.config import MapperConfig, config_from
from lineloom_core.mapping.facts.thesis_tracker import ThesisTracker
from lineloom_core.mapping.facts.tracker import Tracked, Tracker
from lineloom_core.mapping.facts.trackers import new_tracker
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Scan
from lineloom_lab.experiments.recording import Recording, closed_path
from lineloom_lab.simulation import World, sick_lms200

from tests.core.mapping.drives import covered, track

THESIS = config_from({"matcher": "thesis"})


@pytest.fixture(scope="module")
def dense() -> Recording:
    """A metre and a half of the thesis's path, 1.4 cm from scan to scan."""
    return closed_path(0, share=0.035)


@pytest.fixture(scope="module")
def followed(dense: Recording) -> list[Tracked]:
    tracker = ThesisTracker()
    return [track(tracker, scan) for scan in dense.scans]


def offs(true: list[Pose], found: list[Pose]) -> list[Pose]:
    """By how much steps from one to the next are wrong."""
    steps = zip(true, true[1:], found, found[1:], strict=False)
    return [a.between(b).between(c.between(d)) for a, b, c, d in steps]


def test_the_parameter_decides_what_follows_a_robot() -> None:
    assert type(new_tracker(MapperConfig())) is Tracker
    assert type(new_tracker(THESIS)) is ThesisTracker


def test_the_thesis_s_path_is_followed_scan_by_scan(
    dense: Recording, followed: list[Tracked]
) -> None:
    assert [f.status for f in followed] == ["first"] + ["tracked"] * (len(dense) - 1)
    poses = [f.pose for f in followed if f.pose is not None]
    errors = [dense.poses[0].between(t).between(p) for t, p in zip(dense.poses, poses, strict=True)]
    assert max(math.hypot(e.x, e.y) for e in errors) < 0.06
    assert 3 <= sum(f.is_keyframe for f in followed) <= 12


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_of_23_scans_many_have_no_place_and_none_a_wrong_one(seed: int) -> None:
    recording = closed_path(seed, 23)
    tracker, tracks = ThesisTracker(), list[list[tuple[Pose, Pose]]]()
    for scan, true in zip(recording.scans, recording.poses, strict=True):
        found = track(tracker, scan)
        if found.status == "lost":
            tracker = ThesisTracker()
            found = track(tracker, scan)
        if found.status == "first":
            tracks.append([])
        if found.pose is not None:
            tracks[-1].append((true, found.pose))
    wrong = [o for t in tracks for o in offs([a for a, _ in t], [b for _, b in t])]
    assert len(wrong) >= 6, "nothing was matched"
    assert max(math.hypot(o.x, o.y) for o in wrong) < 0.15
    assert max(abs(o.theta) for o in wrong) < math.radians(3.0)


def test_the_clock_decides_nothing(dense: Recording, followed: list[Tracked]) -> None:
    tracker = ThesisTracker()
    found = [track(tracker, scan, stamp=100.0 - 7.0 * scan.stamp) for scan in dense.scans[:30]]
    assert [f.pose for f in found] == [f.pose for f in followed[:30]]


def test_it_goes_on_from_what_was_stored_with_the_same_bits(
    dense: Recording, followed: list[Tracked]
) -> None:
    tracker = ThesisTracker()
    for scan in dense.scans[:40]:
        track(tracker, scan)
    resumed = decode(encode(tracker), ThesisTracker)
    assert encode(resumed) == encode(tracker)
    found = [track(resumed, scan) for scan in dense.scans[40:60]]
    assert [f.pose for f in found] == [f.pose for f in followed[40:60]]


def test_a_covered_lidar_costs_its_scans_and_patience_ends(dense: Recording) -> None:
    tracker = ThesisTracker()
    blocked = {5, 6, 7}
    scans = [covered(s) if i in blocked else s for i, s in enumerate(dense.scans[:12])]
    found = [track(tracker, scan) for scan in scans]
    assert [i for i, f in enumerate(found) if f.pose is None] == sorted(blocked)
    status = [track(tracker, covered(s)).status for s in dense.scans[12:16]]
    assert status == ["skipped", "skipped", "skipped", "lost"]


def test_a_track_ends_once_the_robot_has_moved_on_elsewhere(dense: Recording) -> None:
    tracker = ThesisTracker()
    for scan in dense.scans[:10]:
        track(tracker, scan)
    lidar, rng = sick_lms200(), np.random.default_rng(0)
    world = World(
        np.array(
            [
                *([0.0, 0.0, 3.0, 0.0], [3.0, 0.0, 3.0, 1.2], [3.0, 1.2, 4.1, 1.2]),
                *([4.1, 1.2, 4.1, 2.9], [4.1, 2.9, 0.0, 3.6], [0.0, 3.6, 0.0, 0.0]),
            ]
        )
    )
    elsewhere = [lidar.scan(world, Pose(1.0 + 0.5 * k, 1.5, 0.2), rng) for k in range(2)]
    assert [track(tracker, scan).status for scan in elsewhere] == ["skipped", "lost"]


@pytest.mark.parametrize("wheels", [True, False])
def test_the_way_along_a_corridor_is_said_to_be_unknown(*, wheels: bool) -> None:
    walls = World(np.array([[-80.0, 1.1, 80.0, 1.1], [80.0, -1.1, -80.0, -1.1]]))
    lidar, rng, tracker = sick_lms200(), np.random.default_rng(0), ThesisTracker()
    found = []
    for k in range(12):
        pose = Pose(0.1 * k, 0.02 * k, 0.02 * k)
        scan = lidar.scan(walls, pose, rng, stamp=0.2 * k, seq=k)
        scan = replace(scan, ranges=np.where(scan.ranges < 8.0, scan.ranges, np.inf))
        found.append(track(tracker, replace(scan, odometry=pose if wheels else None)))
    last = found[-1]
    assert last.pose is not None
    x, y, theta = np.array(last.pose.to_array())
    assert (y, theta) == (pytest.approx(0.22, abs=0.05), pytest.approx(0.22, abs=0.02))
    assert x == pytest.approx(1.1 if wheels else 0.0, abs=0.05)
    along = np.array([math.cos(theta), -math.sin(theta), 0.0])  # in the laser's axes
    across = np.array([math.sin(theta), math.cos(theta), 0.0])
    assert along @ last.information @ along < 0.01 * (across @ last.information @ across)


def test_a_site_is_mapped_with_it(dense: Recording) -> None:
    mapper = SiteMapper(THESIS)
    for scan in dense.scans:
        mapper.add("r", scan)
    resumed = SiteMapper.resume(mapper.snapshot())
    extra: Scan = replace(dense.scans[-1], seq=len(dense), stamp=dense.scans[-1].stamp + 0.03)
    for one in (mapper, resumed):
        one.add("r", extra)
    view, other = mapper.view(), resumed.view()
    assert len(view.components) == 1
    assert len(view.trajectories["r"].seq) == len(dense) + 1
    assert np.array_equal(view.trajectories["r"].poses, other.trajectories["r"].poses)
    usual = SiteMapper()
    for scan in dense.scans:
        usual.add("r", scan)
    assert not np.array_equal(
        usual.view().trajectories["r"].poses[-1], view.trajectories["r"].poses[-2]
    )
