"""What one robot may do to a site: be late, restart, hang upside down, be carried, be deleted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Mount
from lineloom_lab.simulation import (
    Lidar,
    SimulatedRobot,
    SimulatedScan,
    corridors,
    rooms,
    scanner_360,
    sick_lms200,
)

from tests.core.mapping.drives import component_error, covered, feed, fingerprint, mapped


def wandering(seed: int = 3, duration_s: float = 40.0, name: str = "r") -> SimulatedRobot:
    return SimulatedRobot.wandering(
        name, rooms(2), lidar=sick_lms200(), seed=seed, duration_s=duration_s
    )


@pytest.fixture(scope="module")
def drive() -> list[SimulatedScan]:
    return list(wandering().scans())


def test_late_scans_are_filled_in_and_leave_the_track_alone(drive: list[SimulatedScan]) -> None:
    late = [s for s in drive if s.scan.seq % 7 == 3 or 60 <= s.scan.seq < 70]
    on_time = [s for s in drive if s not in late]
    plain = mapped(on_time).view()
    mapper = mapped(on_time)
    changes = feed(mapper, late)
    assert all(c.placed and c.keyframe is None and not c.optimised for c in changes)
    view = mapper.view()
    assert component_error(view, drive).max < 0.1
    assert len(view.trajectories["r"].seq) == len(drive)
    assert view.keyframes == plain.keyframes
    assert view.lines == plain.lines
    robot = view.robots["r"]
    assert robot.pose == plain.robots["r"].pose  # the latest scan is still the latest
    assert robot.latest_seq == drive[-1].scan.seq


def test_tracking_goes_on_from_before_the_late_scan(drive: list[SimulatedScan]) -> None:
    late, rest = drive[20], [s for s in drive if s.scan.seq != 20]
    mixed = [*rest[:100], late, *rest[100:]]
    a, b = mapped(rest).view(), mapped(mixed).view()
    own = [i for i, seq in enumerate(b.trajectories["r"].seq) if seq != 20]
    np.testing.assert_array_equal(b.trajectories["r"].poses[own], a.trajectories["r"].poses)
    assert b.keyframes == a.keyframes


def test_a_late_scan_that_fits_nowhere_is_not_placed(drive: list[SimulatedScan]) -> None:
    mapper = mapped(drive[30:100])
    before = mapper.view()
    assert not mapper.add("r", covered(drive[10].scan)).placed
    after = mapper.view()
    assert len(after.trajectories["r"].seq) == len(before.trajectories["r"].seq)
    lost = list(after.trajectories["r"].rows())[-1]
    assert lost == ("0", 10, drive[10].scan.stamp, None, None)
    assert after.robots["r"].scans_processed == before.robots["r"].scans_processed + 1


def test_a_new_session_is_a_new_component_without_a_link(drive: list[SimulatedScan]) -> None:
    # Too short for places: nothing but a link that must not be could join the two.
    again = [replace(s, scan=replace(s.scan, session="1")) for s in drive[:20]]
    mapper = mapped(drive[:20])
    changes = feed(mapper, again)
    view = mapper.view()
    first, second = (c.id for c in view.components)
    assert changes[0].started_component == second != first
    session = {k.id: k.session for k in view.keyframes}
    assert all(session[c.keyframe_a] == session[c.keyframe_b] for c in view.constraints)
    assert view.trajectories["r"].session == ("0",) * 20 + ("1",) * 20
    assert view.trajectories["r"].component == (first,) * 20 + (second,) * 20


def test_a_late_scan_of_an_earlier_session_leaves_the_new_one_alone(
    drive: list[SimulatedScan],
) -> None:
    first = [s for s in drive[:60] if s.scan.seq != 25]
    second = [replace(s, scan=replace(s.scan, session="1")) for s in drive[60:120]]
    mapper = mapped([*first, *second[:30]])
    change = mapper.add("r", drive[25].scan)
    assert change.placed
    assert (change.started_component, change.keyframe) == (None, None)
    feed(mapper, second[30:])
    plain, view = mapped([*first, *second]).view(), mapper.view()
    assert view.components == plain.components
    assert view.keyframes == plain.keyframes
    assert view.robots["r"].latest_session == "1"
    assert component_error(view, [*drive[:60], *second]).max < 0.1


def test_a_carried_robot_is_lost_and_starts_anew_without_a_link(
    drive: list[SimulatedScan],
) -> None:
    elsewhere = SimulatedRobot.wandering(
        "r", corridors(4), lidar=sick_lms200(), seed=5, duration_s=12.0
    )
    after = [replace(s, scan=replace(s.scan, seq=1000 + s.scan.seq)) for s in elsewhere.scans()]
    mapper = mapped(drive[:80])
    changes = feed(mapper, after)
    assert [c.placed for c in changes[:4]] == [False, False, False, True]
    view = mapper.view()
    assert [changes[3].started_component] == [c.id for c in view.components[1:]]
    rows = list(view.trajectories["r"].rows())
    assert [r[1] for r in rows] == [s.scan.seq for s in (*drive[:80], *after)]
    assert [r[3:] for r in rows[80:83]] == [(None, None)] * 3
    assert all(r[3] is not None and r[4] is not None for r in (*rows[:80], *rows[83:]))
    assert view.robots["r"].state == "tracking"
    component = {k.id: k.component for k in view.keyframes}
    assert all(component[c.keyframe_a] == component[c.keyframe_b] for c in view.constraints)
    for c in view.components:
        assert component_error(view, [*drive[:80], *after], c.id).max < 0.1


def test_a_forgotten_robot_is_gone_and_may_come_back(drive: list[SimulatedScan]) -> None:
    other = [replace(s, robot="other") for s in wandering(seed=8).scans()]
    both = [s for pair in zip(drive, other, strict=False) for s in pair]
    mapper = mapped(both)
    mapper.forget("other")
    view = mapper.view()
    assert list(view.robots) == list(view.trajectories) == ["r"]
    assert {k.robot for k in view.keyframes} == {"r"}
    assert {r for line in view.lines for r in line.robots} == {"r"}
    assert all(c.robots == ("r",) for c in view.components)
    kept = {k.id for k in view.keyframes}
    assert all({c.keyframe_a, c.keyframe_b} <= kept for c in view.constraints)
    before = {k.id for k in mapped(both).view().keyframes if k.robot == "other"}
    feed(mapper, other[:30])
    back = mapper.view()
    assert back.robots["other"].scans_processed == 30
    again = {k.id for k in back.keyframes if k.robot == "other"}
    assert again
    assert again <= before  # named after its scans, whatever came in between
    # And all of it again from a snapshot, as a restart would do it.
    resumed = SiteMapper.resume(mapper.snapshot())
    assert fingerprint(resumed.view()) == fingerprint(back)


def test_forgetting_one_of_two_keeps_the_others_own_map(drive: list[SimulatedScan]) -> None:
    other = [replace(s, robot="other") for s in wandering(seed=8).scans()]
    both = [s for pair in zip(drive, other, strict=False) for s in pair]
    mapper = mapped(both)
    mapper.forget("other")
    assert component_error(mapper.view(), drive, mapper.view().components[0].id).max < 0.1
    feed(mapper, drive[len(both) // 2 :])  # and it drives on as if nothing had happened
    assert component_error(mapper.view(), drive, mapper.view().components[0].id).max < 0.1


CLOCKWISE = replace(sick_lms200(), angle_min=math.pi / 2, angle_increment=-math.radians(1.0))
OFF_CENTRE = replace(sick_lms200(), angle_min=-1.2, angle_increment=math.radians(1.0))


@pytest.mark.parametrize(
    ("lidar", "mount"),
    [
        (sick_lms200(), Mount(inverted=True)),
        (CLOCKWISE, Mount()),
        (CLOCKWISE, Mount(inverted=True)),
        (OFF_CENTRE, Mount(inverted=True)),
        (replace(scanner_360(), beams=360, angle_increment=-math.tau / 360), Mount()),
    ],
    ids=["inverted", "clockwise", "both", "inverted, off centre", "clockwise 360"],
)
def test_every_way_to_sweep_gives_the_true_map_never_its_mirror_image(
    lidar: Lidar, mount: Mount
) -> None:
    scans = list(replace(wandering(duration_s=25.0), lidar=lidar, mount=mount).scans())
    mapper = SiteMapper()
    mapper.set_mount("r", mount)
    feed(mapper, scans)
    view = mapper.view()
    assert len(view.components) == 1
    assert component_error(view, scans).max < 0.1
    assert walls_off(view, scans) < 0.05
    # Taken for an upright lidar, an inverted one cannot give this map.
    if mount.inverted:
        wrong = mapped(scans).view()
        assert len(wrong.components) > 1 or component_error(wrong, scans).max > 0.5


def walls_off(view: SiteView, scans: list[SimulatedScan]) -> float:
    """Median distance [m] of the map's line middles from the nearest true wall."""
    T_world_map = component_error(view, scans).T_truth_estimate
    middles = T_world_map.transform(
        [(0.5 * (line.x1 + line.x2), 0.5 * (line.y1 + line.y2)) for line in view.lines]
    )
    world = rooms(2)
    return float(np.median([world.clearance(x, y) for x, y in middles.tolist()]))


def test_the_mount_shows_in_the_trajectory(drive: list[SimulatedScan]) -> None:
    mount = Mount(Pose(0.3, -0.1, 2.0))
    robot = replace(wandering(duration_s=20.0), mount=mount)
    scans = list(robot.scans())
    bare = mapped(scans).view().trajectories["r"].poses  # poses of the laser
    mapper = SiteMapper()
    mapper.set_mount("r", mount)
    feed(mapper, scans)
    view = mapper.view()
    for laser, base in zip(bare, view.trajectories["r"].poses, strict=True):
        expected = Pose.from_array(laser) @ mount.T_base_laser.inverse()
        np.testing.assert_allclose(base, expected.to_array(), atol=1e-9)
    # The base's own path is that of the drive.
    bases = np.array([robot.drive.pose_at(s.time_s).to_array() for s in scans])
    start = Pose.from_array(view.trajectories["r"].poses[0])
    for i in (len(scans) // 2, -1):
        true = Pose.from_array(bases[0]).between(Pose.from_array(bases[i]))
        found = start.between(Pose.from_array(view.trajectories["r"].poses[i]))
        assert true.distance(found) < 0.05


def test_a_mount_may_be_set_after_the_drive(drive: list[SimulatedScan]) -> None:
    mount = Mount(Pose(0.2, 0.0, 0.5))
    before, after = SiteMapper(), mapped(drive[:60])
    before.set_mount("r", mount)
    feed(before, drive[:60])
    after.set_mount("r", mount)
    assert fingerprint(before.view()) == fingerprint(after.view())
