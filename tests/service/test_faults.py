"""A disk that is full, read-only or broken: a clear answer, nothing half-taken, others go on."""

from __future__ import annotations

import asyncio
import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
from lineloom_core.scan import Scan
from lineloom_service.engine.conductor import Conductor
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.settings import Settings
from lineloom_service.store.actions import append_scans
from lineloom_service.store.codec import encode_scan
from lineloom_service.store.reads import read_feed
from lineloom_service.store.records import NewScan, StorageFullError
from lineloom_service.store.sql_store import SqlStore
from lineloom_service.store.sqlite_database import SqliteDatabase
from sqlalchemy import event

PAGE = 4096


def _store(path: Path) -> SqlStore:
    return SqlStore(SqliteDatabase(path / "lineloom.db"), gap_window_s=0.2, max_held=1000)


def _scan(seq: int, beams: int = 20) -> NewScan:
    rng = np.random.default_rng(seq)
    scan = Scan.checked(
        rng.uniform(1.0, 20.0, beams),
        angle_min=-1.0,
        angle_increment=0.001,
        range_min=0.1,
        range_max=30.0,
        stamp=float(seq),
        seq=seq,
    )
    return NewScan("0", seq, encode_scan(scan))


async def _post(store: SqlStore, seqs: range, site: str = "s", beams: int = 20) -> int:
    scans = [_scan(seq, beams) for seq in seqs]
    answer = await store.write(append_scans, site, "r", scans, processed=0, limit=10**9)
    return answer.accepted


async def test_a_full_disk_refuses_whole_posts_and_goes_on_when_there_is_room(
    tmp_path: Path,
) -> None:
    database = SqliteDatabase(tmp_path / "lineloom.db")
    store = SqlStore(database, gap_window_s=0.2, max_held=1000)
    await store.open()
    taken = await _post(store, range(10))

    def set_limit(pages: int) -> None:
        """SQLite answers "disk is full" beyond so many pages, as it does on a full disk."""
        assert database._engine is not None
        database._engine.dispose()

        @event.listens_for(database._engine, "connect")
        def _limit(connection: sqlite3.Connection, _record: object) -> None:
            connection.execute(f"PRAGMA max_page_count = {pages}")

    size = (tmp_path / "lineloom.db").stat().st_size + (tmp_path / "lineloom.db-wal").stat().st_size
    set_limit(size // PAGE + 20)
    for start in range(10, 2000, 10):
        try:
            taken += await _post(store, range(start, start + 10), beams=800)
        except StorageFullError as error:
            refusal = str(error)
            break
    assert "is full: nothing of the request was taken" in refusal
    assert taken % 10 == 0
    record = await store.site("s")
    assert record is not None
    assert record.accepted == taken  # the refused ten are not among them
    entries = await store.read(read_feed, record.id, 0, 10**6)
    assert [entry.seq for entry in entries] == list(range(taken))
    set_limit(10**6)
    assert await _post(store, range(taken, taken + 10)) == 10
    await store.close()


async def test_a_read_only_directory_is_refused_with_its_name(tmp_path: Path) -> None:
    """By a process without root's rights, to whom nothing is read-only."""
    data = tmp_path / "data"
    data.mkdir()
    data.chmod(0o555)
    tmp_path.chmod(0o755)
    program = (
        "import os, sys, asyncio\n"
        "from pathlib import Path\n"
        "from lineloom_service.store.sqlite_database import SqliteDatabase\n"
        "if os.getuid() == 0: os.setuid(65534)\n"
        "asyncio.run(SqliteDatabase(Path(sys.argv[1]) / 'lineloom.db').open())\n"
    )
    for folder in tmp_path.parents:  # pytest keeps its folders to their owner
        if folder.stat().st_uid == os.getuid() and folder != Path("/"):
            folder.chmod(folder.stat().st_mode | 0o011)
        if folder == Path("/tmp"):
            break
    done = subprocess.run(
        [sys.executable, "-c", program, str(data)], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert f"StoreError: cannot use {data}: Permission denied" in done.stderr


async def test_a_broken_page_costs_its_entry_is_told_and_stops_nothing(
    tmp_path: Path,
) -> None:
    store = _store(tmp_path)
    await store.open()
    for site in ("broken", "well"):
        await _post(store, range(40), site=site, beams=800)
    await store.close()
    _break_a_page(tmp_path / "lineloom.db", "broken")
    store = _store(tmp_path)
    await store.open()
    engine = LocalEngine(1, publish_every_s=0.05, mapper="fake_mapper:FakeMapper", warm_up=None)
    settings = Settings(data_dir=tmp_path)
    conductor = Conductor(store, engine, settings)
    await conductor.start()
    records = {record.name: record for record in await store.sites()}
    for _ in range(3000):
        well, broken = (conductor.published(records[name].id) for name in ("well", "broken"))
        if well.position == broken.position == 40:
            break
        await asyncio.sleep(0.02)
    assert (well.position, well.skipped) == (40, 0)
    assert (broken.position, broken.skipped, broken.scans) == (40, 1, 39)
    assert conductor.trouble(records["well"].id) is None
    trouble = conductor.trouble(records["broken"].id) or ""
    assert "of its log" in trouble
    assert "is damaged and left out" in trouble
    assert not any("broken" in reason for reason in conductor.not_ready())
    assert await _post(store, range(40, 50), site="well") == 10
    await conductor.stop()
    await store.close()


def _break_a_page(file: Path, site: str) -> None:
    """Overwrite a page that holds scans of one site only: an overflow page of its first entry."""
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    (body,) = connection.execute(
        "SELECT body FROM entries JOIN sites ON sites.id = site_id WHERE name = ? AND seq = 3",
        (site,),
    ).fetchone()
    connection.close()
    data = bytearray(file.read_bytes())
    start = data.index(body[1000:2000])  # in the first page that this entry alone runs over to
    page = start // PAGE
    data[page * PAGE : page * PAGE + 8] = b"\xff" * 8
    file.write_bytes(data)
