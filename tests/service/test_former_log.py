"""A log of the first version, which named constraints by number, keeps its meaning."""

from __future__ import annotations

import logging
import sqlite3
import zlib
from contextlib import closing
from pathlib import Path

import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.mapping.facts.ids import id_of
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import Fleet, SimulatedScan, rooms, sick_lms200
from lineloom_service.engine.mapper import apply
from lineloom_service.store.codec import decode_claim
from lineloom_service.store.migrations.former_verdicts import meanings
from lineloom_service.store.migrations.inert_pickle import Made, read_inert
from lineloom_service.store.reads import read_feed
from lineloom_service.store.sql_store import SqlStore
from lineloom_service.store.sqlite_database import SqliteDatabase
from lineloom_service.store.sqlite_upgrade import upgrade_file

from tests.service.bombs import bomb
from tests.service.former_version import Former, make_former_file, snapshot

# What commit 1e926c0 made of the scans of `log`, out of the file that it wrote.
MEETING = Former("rendezvous", 97, 100, Pose(2.051227925726418, -0.288818559197205, 1.9967929433))
STEP = Former("sequential", 70, 72, Pose(0.19474904724373654, -0.04174296176947878, -0.3973340823))
SCANS = {
    70: ("robot-2", "0", 120),
    72: ("robot-2", "0", 122),
    97: ("robot-2", "0", 166),
    100: ("robot-1", "0", 173),
    114: ("robot-1", "0", 199),
}
KEYFRAMES = [SCANS.get(i, ("robot-2", "0", i)) for i in range(143)]
SAVED = snapshot(KEYFRAMES, {"s72": STEP}, {"p97-100": MEETING})
"""The other keyframes are of other scans than they were: nothing here asks for those."""


@pytest.fixture(scope="module")
def log() -> list[SimulatedScan]:
    """Two robots in four rooms, who meet."""
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=50.0, lidar=sick_lms200())
    return list(fleet.scans())


def _bodies(path: Path) -> list[Claim | str]:
    with closing(sqlite3.connect(path)) as connection:
        query = "SELECT body FROM entries WHERE kind != 'scan' ORDER BY position"
        return [decode_claim(body) for (body,) in connection.execute(query)]


async def test_what_was_retracted_by_number_is_out(
    tmp_path: Path, log: list[SimulatedScan]
) -> None:
    path = tmp_path / "lineloom.db"
    make_former_file(path, log, [("retract", "robot-1", "p97-100")], SAVED)
    store = SqlStore(SqliteDatabase(path), gap_window_s=60.0, max_held=1000)
    await store.open()
    entries = await store.read(read_feed, 1, 0, 10**5)
    await store.close()
    assert len(entries) == len(log) + 1
    mapper = SiteMapper()
    for entry in entries[:-1]:
        apply(mapper, entry)
    assert len(mapper.view().components) == 1
    apply(mapper, entries[-1])
    view = mapper.view()
    assert {c.robots for c in view.components} == {("robot-1",), ("robot-2",)}
    (retracted,) = [c for c in view.constraints if c.state == "retracted"]
    assert retracted.id == id_of("recognition", *(ScanName(*SCANS[k]) for k in (97, 100)))
    # Where no place ends with those scans any more, it stands for keyframes before them.
    true = {(s.robot, s.scan.seq): s.true_pose for s in log}
    claim = retracted.claim
    a, b = (true[name.robot, name.seq] for name in (claim.scan_a, claim.scan_b))
    off = claim.T_a_b.between(a.between(b))
    assert abs(off.x) + abs(off.y) + abs(off.theta) < 0.1


def test_the_log_says_what_the_constraints_said(
    tmp_path: Path, log: list[SimulatedScan], caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "lineloom.db"
    names = ("p97-100", "s72", "n70-114", "p97-143", "what?")
    actions = [("retract", "robot-2", name) for name in names] + [("restore", "robot-2", "s72")]
    make_former_file(path, log[:3], actions, SAVED)
    caplog.set_level(logging.WARNING)
    upgrade_file(path)
    a, b, last = (ScanName(*SCANS[k]) for k in (70, 72, 114))
    meeting, step, near, beyond, odd, restored = _bodies(path)
    assert isinstance(meeting, Claim)
    assert (meeting.scan_a, meeting.scan_b) == (ScanName(*SCANS[97]), ScanName(*SCANS[100]))
    assert (meeting.kind, meeting.origin) == ("rendezvous", "recognition")
    assert meeting.T_a_b == MEETING.T_a_b
    assert step == restored == Claim(id_of("step", b), "sequential", "step", a, b, STEP.T_a_b)
    assert near == id_of("near", a, last), "no constraint any more, so by what it would be called"
    assert (beyond, odd) == ("p97-143", "what?")
    assert "no snapshot knows p97-143, which its log names" in caplog.text
    assert "n70-114" not in caplog.text


def test_without_a_snapshot_the_names_stay_and_that_is_said(
    tmp_path: Path, log: list[SimulatedScan], caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "lineloom.db"
    make_former_file(path, log[:3], [("retract", "robot-2", "s72")])
    upgrade_file(path)
    assert _bodies(path) == ["s72"]
    assert "no snapshot knows s72" in caplog.text


@pytest.mark.parametrize("packed", [True, False])
def test_a_bomb_for_a_snapshot_does_not_go_off(
    tmp_path: Path, log: list[SimulatedScan], caplog: pytest.LogCaptureFixture, packed: bool
) -> None:
    path, fuse = tmp_path / "lineloom.db", tmp_path / "fuse"
    forged = zlib.compress(bomb(fuse)) if packed else bomb(fuse)
    make_former_file(path, log[:3], [("retract", "robot-2", "s72")], forged)
    upgrade_file(path)
    assert not fuse.exists()
    assert _bodies(path) == ["s72"]
    assert "a snapshot is not read" in caplog.text


def test_a_pickle_is_read_without_doing_it(tmp_path: Path) -> None:
    found = read_inert(bomb(tmp_path / "fuse"))
    assert isinstance(found, Made)
    assert found.by.endswith("touch") or found.by == "builtins.getattr"
    assert not (tmp_path / "fuse").exists()


def test_damaged_snapshots_are_refused() -> None:
    whole = zlib.decompress(SAVED)
    for end in range(0, len(whole), 7):
        with pytest.raises(ValueError, match="not a snapshot of a former version"):
            meanings(zlib.compress(whole[:end]))
