"""What is SQLite's alone: its directory, its file, and how an older one is upgraded."""

from __future__ import annotations

from pathlib import Path

import pytest
import sqlalchemy as sa
from lineloom_service.store.actions import append_scans
from lineloom_service.store.migrate import downgrade, migrate
from lineloom_service.store.reads import read_feed
from lineloom_service.store.records import NewScan, SnapshotRecord, StoreError
from lineloom_service.store.snapshots import read_chapters, read_snapshot, save_snapshot
from lineloom_service.store.sql_store import SqlStore
from lineloom_service.store.sqlite_database import SqliteDatabase
from lineloom_service.store.sqlite_engine import sqlite_engine

from tests.service.old_databases import SCANS, make_old_file


def _store(path: Path) -> SqlStore:
    return SqlStore(SqliteDatabase(path / "lineloom.db"), gap_window_s=60.0, max_held=1000)


async def test_a_database_of_the_first_version_is_upgraded_with_all_it_holds(
    tmp_path: Path,
) -> None:
    make_old_file(tmp_path / "lineloom.db", "0001")
    store = _store(tmp_path)
    await store.open()
    record = await store.site("site")
    assert record is not None
    assert (record.position, record.held, record.accepted) == (4, 1, 4)
    assert record.robots["r"].mount == b"m"
    assert list(record.robots) == ["r"]
    again = await store.write(
        append_scans, "site", "r", [*SCANS, NewScan("0", 3, b"scan 3")], processed=0, limit=100
    )
    assert (again.accepted, again.duplicates) == (1, 4)
    feed = await store.read(read_feed, record.id, 0, 100)
    assert [(e.kind, e.seq, e.body) for e in feed] == [
        ("mount", None, b"m"),
        *(("scan", seq, b"scan %d" % seq) for seq in range(5)),
    ]
    await store.write_as_engine(save_snapshot, record.id, SnapshotRecord(6, 5, "v1", b"state"))
    await store.close()


async def test_a_snapshot_from_before_there_were_chapters_goes_on_from_none(
    tmp_path: Path,
) -> None:
    make_old_file(tmp_path / "lineloom.db", "0007")
    store = _store(tmp_path)
    await store.open()
    snapshot = await store.read(read_snapshot, 1, "v1")
    assert snapshot == SnapshotRecord(4, 3, "v1", b"old")
    assert [chapter async for chapter in read_chapters(store, 1, snapshot)] == []
    await store.close()


async def test_going_back_a_version_leaves_no_snapshot_without_its_chapters(
    tmp_path: Path,
) -> None:
    make_old_file(tmp_path / "lineloom.db", "0001")
    store = _store(tmp_path)
    await store.open()
    await store.write_as_engine(save_snapshot, 1, SnapshotRecord(2, 1, "v1", b"whole"))
    await store.write_as_engine(
        save_snapshot, 1, SnapshotRecord(4, 3, "v1", b"rest", 0, (b"chapter",))
    )
    await store.close()
    engine = sqlite_engine(tmp_path / "lineloom.db")
    with engine.begin() as connection:
        downgrade(connection, "0007")
        left = connection.exec_driver_sql("SELECT * FROM snapshots").fetchall()
        assert [tuple(row) for row in left] == [(1, 2, 1, "v1", b"whole")]
        assert "chapters" not in sa.inspect(connection).get_table_names()
    engine.dispose()


async def test_the_upgrade_leaves_a_copy_of_the_database_as_it_was(tmp_path: Path) -> None:
    make_old_file(tmp_path / "lineloom.db", "0001")
    for _ in range(2):  # the second start finds nothing to upgrade
        store = _store(tmp_path)
        await store.open()
        await store.close()
    (copy,) = tmp_path.glob("*.backup*")
    assert copy.name == "lineloom.db.backup-0001"
    engine = sa.create_engine(f"sqlite:///{copy}")
    with engine.connect() as connection:
        assert "snapshots" not in sa.inspect(connection).get_table_names()
        assert connection.exec_driver_sql("SELECT count(*) FROM entries").scalar() == 5
        assert connection.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"
    engine.dispose()


async def test_no_copy_takes_the_place_of_another(tmp_path: Path) -> None:
    (tmp_path / "lineloom.db.backup-0001").write_text("of long ago")
    make_old_file(tmp_path / "lineloom.db", "0001")
    store = _store(tmp_path)
    await store.open()
    await store.close()
    assert (tmp_path / "lineloom.db.backup-0001").read_text() == "of long ago"
    assert (tmp_path / "lineloom.db.backup-0001.2").is_file()


async def test_a_new_database_needs_no_copy(tmp_path: Path) -> None:
    store = _store(tmp_path)
    await store.open()
    await store.close()
    assert list(tmp_path.glob("*.backup*")) == []


async def test_a_newer_database_is_refused_in_plain_words(tmp_path: Path) -> None:
    engine = sqlite_engine(tmp_path / "lineloom.db")
    with engine.begin() as connection:
        migrate(connection)
        connection.execute(sa.text("UPDATE alembic_version SET version_num = '9999'"))
    engine.dispose()
    with pytest.raises(StoreError, match="newer version"):
        await _store(tmp_path).open()


async def test_a_second_service_on_the_same_directory_is_refused(tmp_path: Path) -> None:
    store = _store(tmp_path)
    await store.open()
    with pytest.raises(StoreError, match="another Lineloom service"):
        await _store(tmp_path).open()
    await store.close()


async def test_an_unusable_directory_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot use"):
        await _store(tmp_path / "file").open()
