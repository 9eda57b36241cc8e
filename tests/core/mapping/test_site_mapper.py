"""The site's mapper as a state machine: the same log gives the same bits, whatever happens."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.mapping.snapshot import Snapshot, SnapshotError
from lineloom_core.scan import Mount, Scan
from lineloom_lab.simulation import Fleet, SimulatedScan, rooms, sick_lms200

from tests.core.mapping.drives import component_error, empty, feed, fingerprint, mapped

GO_ON = """
import hashlib, pickle, sys
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.site_mapper import SiteMapper
sys.path.insert(0, sys.argv[1])
from tests.core.mapping.drives import feed, fingerprint
snapshot, rest = pickle.load(sys.stdin.buffer)
mapper = SiteMapper.resume(snapshot) if snapshot else SiteMapper()
feed(mapper, rest)
print(hashlib.sha256(repr(fingerprint(mapper.view())).encode()).hexdigest())
"""


def digest_elsewhere(snapshot: Snapshot | None, rest: list[SimulatedScan], hash_seed: int) -> str:
    """The digest of the view that a fresh process ends with."""
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", GO_ON, str(root)],
        input=pickle.dumps((snapshot, rest)),
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONHASHSEED": str(hash_seed)},
        check=True,
    )
    return done.stdout.decode().strip()


@pytest.fixture(scope="module")
def log() -> list[SimulatedScan]:
    """Two robots in four rooms; they meet after half a minute."""
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=50.0, lidar=sick_lms200())
    return list(fleet.scans())


@pytest.fixture(scope="module")
def whole(log: list[SimulatedScan]) -> SiteView:
    return mapped(log).view()


def test_the_log_is_worth_testing_with(log: list[SimulatedScan], whole: SiteView) -> None:
    kinds = {(c.kind, c.state) for c in whole.constraints}
    assert {("sequential", "accepted"), ("loop", "accepted"), ("rendezvous", "accepted")} <= kinds
    assert [c.robots for c in whole.components] == [("robot-1", "robot-2")]
    assert component_error(whole, log).max < 0.1
    assert len(whole.lines) > 40


def test_the_same_log_gives_the_same_bits(log: list[SimulatedScan], whole: SiteView) -> None:
    assert fingerprint(mapped(log).view()) == fingerprint(whole)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_going_on_from_a_snapshot_gives_the_same_bits(
    log: list[SimulatedScan], whole: SiteView, share: float
) -> None:
    half = int(share * len(log))
    snapshot = mapped(log[:half]).snapshot()
    resumed = SiteMapper.resume(snapshot)
    assert resumed.snapshot() == snapshot, "something of the state was lost or came back otherwise"
    feed(resumed, log[half:])
    assert fingerprint(resumed.view()) == fingerprint(whole)


def test_how_long_chapters_are_changes_nothing(log: list[SimulatedScan], whole: SiteView) -> None:
    mappers = [SiteMapper(MapperConfig(chapter=length)) for length in (8, 10_000)]
    for mapper in mappers:
        feed(mapper, log)
        assert fingerprint(mapper.view()) == fingerprint(whole)
    met = next(c.id for c in whole.constraints if c.kind == "rendezvous" and c.state == "accepted")
    for mapper in mappers:
        mapper.retract(met)
        mapper.forget("robot-1")
        mapper.restore(met)
        feed(mapper, log[50:150])  # late, or of a robot that was forgotten
    short, long = (fingerprint(mapper.view()) for mapper in mappers)
    assert short == long


def test_a_later_snapshot_repeats_no_chapter(log: list[SimulatedScan], whole: SiteView) -> None:
    half = len(log) // 2
    mapper = SiteMapper(MapperConfig(chapter=8))
    feed(mapper, log[:half])
    first = mapper.snapshot()
    feed(mapper, log[half:])
    second = mapper.snapshot(known=first.end)
    assert 0 < first.end < second.end
    together = Snapshot(second.state, 0, (*first.chapters, *second.chapters))
    resumed = SiteMapper.resume(together)
    assert fingerprint(resumed.view()) == fingerprint(whole)
    assert resumed.snapshot().chapters == together.chapters


def test_a_snapshot_without_its_chapters_is_named(log: list[SimulatedScan]) -> None:
    mapper = SiteMapper(MapperConfig(chapter=8))
    feed(mapper, log[:200])
    whole = mapper.snapshot()
    for chapters in ((), whole.chapters[:-1], (*whole.chapters[:-1], b"damaged")):
        with pytest.raises(SnapshotError):
            SiteMapper.resume(Snapshot(whole.state, 0, chapters))
    with pytest.raises(SnapshotError):
        SiteMapper.resume(mapper.snapshot(known=1))


def test_a_fresh_process_with_other_hashes_ends_with_the_same_bits(
    log: list[SimulatedScan],
) -> None:
    half = len(log) // 2
    snapshot = mapped(log[:half]).snapshot()
    resumed = digest_elsewhere(snapshot, log[half:], hash_seed=1)
    from_scratch = digest_elsewhere(None, log, hash_seed=2)
    assert len(resumed) == 64
    assert resumed == from_scratch


def test_a_resumed_mapper_answers_at_once(log: list[SimulatedScan]) -> None:
    mapper = mapped(log[:200])
    resumed = SiteMapper.resume(mapper.snapshot())
    assert resumed.version == mapper.version == 200
    assert fingerprint(resumed.view()) == fingerprint(mapper.view())


@pytest.mark.parametrize("data", [b"", b"no message", encode(("only", "two")), None])
def test_an_unreadable_snapshot_is_named(data: bytes | None) -> None:
    if data is None:  # right shape, another version's format
        data = encode((-1, *decode(SiteMapper().snapshot().state, tuple)[1:]))
    with pytest.raises(SnapshotError):
        SiteMapper.resume(Snapshot(data))


def test_a_forged_snapshot_is_refused_or_a_map(log: list[SimulatedScan]) -> None:
    """Whatever was done to its bytes: no other error, and nothing that is not the mapper's."""
    state, rng = mapped(log[:60]).snapshot().state, np.random.default_rng(3)
    refused = 0
    for at in rng.integers(0, len(state), 60).tolist():
        forged = bytearray(state)
        forged[at] ^= int(rng.integers(1, 256))
        try:
            SiteMapper.resume(Snapshot(bytes(forged)))
        except SnapshotError:
            refused += 1
    assert 0 < refused < 60


def test_looking_changes_nothing(log: list[SimulatedScan], whole: SiteView) -> None:
    mapper = SiteMapper()
    for i, entry in enumerate(log):
        mapper.add(entry.robot, entry.scan)
        if i % 40 == 0:
            before = fingerprint(mapper.view())
            mapper.snapshot()
            assert fingerprint(mapper.view()) == before
    assert fingerprint(mapper.view()) == fingerprint(whole)


def test_version_counts_entries_of_every_kind(log: list[SimulatedScan]) -> None:
    mapper = SiteMapper()
    assert (mapper.version, mapper.view().version) == (0, 0)
    feed(mapper, log[:3])
    mapper.add("robot-1", empty(log[3].scan))
    mapper.set_mount("robot-1", Mount())
    mapper.forget("nobody")
    mapper.forget("robot-1")
    assert (mapper.version, mapper.view().version) == (7, 7)


def test_an_empty_site_has_an_empty_view() -> None:
    view = SiteMapper().view()
    assert (view.robots, view.components, view.lines, view.keyframes) == ({}, (), (), ())


def test_changes_tell_what_the_view_then_shows(log: list[SimulatedScan], whole: SiteView) -> None:
    changes = feed(SiteMapper(), log)
    placed = sum(len(t.seq) for t in whole.trajectories.values())
    assert sum(c.placed for c in changes) == placed == len(log)
    assert [c.keyframe for c in changes if c.keyframe is not None] == [
        k.id for k in whole.keyframes
    ]
    first, second = (c.started_component for c in changes if c.started_component)
    assert [first] == [c.id for c in whole.components]
    merges = [m for c in changes for m in c.merges]
    assert [(m.survivor, m.absorbed) for m in merges] == [(first, second)]
    assert whole.merged_into == {second: first}
    by_id = {c.id: c for c in whole.constraints}
    for name in merges[0].constraints:
        assert by_id[name].consistency_set == merges[0].constraints
        assert by_id[name].kind == "rendezvous"


def test_the_view_is_sound(whole: SiteView) -> None:
    keyframes = {k.id: k for k in whole.keyframes}
    for c in whole.constraints:
        a, b = keyframes[c.keyframe_a], keyframes[c.keyframe_b]
        assert (c.residual is not None) == (c.state == "accepted")
        np.testing.assert_allclose(c.information, c.information.T, rtol=1e-6)
        if c.state == "accepted":
            assert a.component == b.component
            assert c.reason
    for name, robot in whole.robots.items():
        trajectory = whole.trajectories[name]
        assert robot.pose is not None
        np.testing.assert_allclose(trajectory.poses[-1], robot.pose.to_array(), atol=1e-12)
        assert (robot.latest_seq, robot.latest_stamp) == (trajectory.seq[-1], trajectory.stamp[-1])
        assert robot.keyframes == sum(k.robot == name for k in whole.keyframes)
        assert robot.covariance is not None
        assert np.linalg.eigvalsh(robot.covariance).min() >= 0.0
    assert len({line.id for line in whole.lines}) == len(whole.lines)
    assert {r for line in whole.lines for r in line.robots} == set(whole.robots)


def test_a_keyframe_stands_where_its_scan_was_placed(whole: SiteView) -> None:
    for name, trajectory in whole.trajectories.items():
        rows = {int(seq): pose for seq, pose in zip(trajectory.seq, trajectory.poses, strict=True)}
        for k in whole.keyframes:
            if k.robot == name:
                np.testing.assert_allclose(rows[k.seq], k.pose.to_array(), atol=1e-12)


def test_a_scan_with_nothing_but_no_returns_is_counted_and_harmless(
    log: list[SimulatedScan],
) -> None:
    own = [s for s in log if s.robot == "robot-1"][:120]
    plain, disturbed = SiteMapper(), SiteMapper()
    feed(plain, own)
    for i, entry in enumerate(own):
        if i in (0, 50, 51, 52, 53, 54, 55, 119):  # more in a row than the tracker has patience
            assert not disturbed.add("robot-1", empty(entry.scan)).placed
            state = disturbed.view().robots["robot-1"].state
            assert state == ("lost" if i else "starting")  # the latest scan has no pose
        disturbed.add("robot-1", entry.scan)
    a, b = plain.view(), disturbed.view()
    assert b.robots["robot-1"].scans_processed == len(own) + 8
    assert b.trajectories["robot-1"].poses.tobytes() == a.trajectories["robot-1"].poses.tobytes()
    assert b.components == a.components
    assert b.robots["robot-1"].state == "tracking"


def test_a_robot_that_has_seen_nothing_yet_is_starting(log: list[SimulatedScan]) -> None:
    mapper = SiteMapper()
    mapper.add("r", empty(log[0].scan))
    robot = mapper.view().robots["r"]
    assert (robot.state, robot.pose, robot.component, robot.keyframes) == (
        "starting",
        None,
        None,
        0,
    )
    assert robot.scans_processed == 1


@pytest.mark.parametrize("beams", [1, 2, 5])
def test_scans_too_poor_to_track_are_survived(beams: int) -> None:
    mapper = SiteMapper()
    for seq in range(20):
        scan = Scan.checked(
            np.full(beams, 2.0),
            angle_min=0.0,
            angle_increment=0.01,
            range_min=0.1,
            range_max=30.0,
            stamp=0.1 * seq,
            seq=seq,
        )
        mapper.add("r", scan)
    view = mapper.view()
    assert view.robots["r"].scans_processed == 20
    assert np.isfinite(view.trajectories["r"].poses).all()
