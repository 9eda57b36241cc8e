"""A database is kept, moved, looked through and salvaged, and what was deleted stays deleted."""

from __future__ import annotations

import asyncio
import sqlite3
from contextlib import AsyncExitStack
from pathlib import Path

import pytest
from lineloom.cli.app import app
from lineloom_service.settings import Settings
from lineloom_service.store import keeping
from lineloom_service.store.actions import append_scans, delete_site, forget_robot, remove_file
from lineloom_service.store.files import FileRecord, list_files, put_file
from lineloom_service.store.postgres_database import PostgresDatabase
from lineloom_service.store.records import StoreError
from lineloom_service.store.sqlite_engine import reading, sqlite_engine
from typer.testing import CliRunner, Result

from tests.service.databases import KINDS, fresh_database
from tests.service.old_databases import Rows, read_all
from tests.service.system import System, fingerprint, new_scan, running

PLAN = FileRecord("plan", "{}", "0" * 64, 1, 1.5, b"p")


def _rows_of_file(path: Path) -> Rows:
    engine = sqlite_engine(path)
    with reading(engine) as connection:
        rows = read_all(connection)
    engine.dispose()
    return _sorted(rows)


async def _rows(settings: Settings) -> Rows:
    """All that a database holds."""
    if settings.database_url is None:
        return _rows_of_file(settings.database_path)
    database = PostgresDatabase(settings.database_url)
    rows = await database.read(read_all)
    await database.close()
    return _sorted(rows)


def _sorted(rows: Rows) -> Rows:
    """In one order, without what SQLite keeps for itself, and each start counts."""
    kept = {name: there for name, there in rows.items() if name not in ("clock", "sqlite_sequence")}
    return {name: sorted(there, key=repr) for name, there in kept.items()}


async def _fill(system: System) -> None:
    await system.post(range(60))
    for site in ("other", "gone"):
        scans = [new_scan(seq) for seq in range(5)]
        await system.store.write(append_scans, site, "r", scans, processed=0, limit=100)
        await system.store.write(append_scans, site, "q", scans, processed=0, limit=100)
    await system.store.write(put_file, 2, "floorplan", PLAN)
    await system.caught_up()


@pytest.mark.parametrize("source", KINDS)
@pytest.mark.parametrize("target", KINDS)
async def test_a_copy_made_while_serving_is_the_same_service_wherever_it_is_restored(
    tmp_path: Path, source: str, target: str
) -> None:
    copy = tmp_path / "copy.db"
    async with AsyncExitStack() as stack:
        urls = [await stack.enter_async_context(fresh_database(k)) for k in (source, target)]
        async with running(tmp_path / "a", urls[0], snapshot_idle_s=0.05) as system:
            await _fill(system)
            before = fingerprint((await system.published()).view)
            await asyncio.to_thread(keeping.back_up, system.settings, copy)
            await system.post(range(60, 70))  # not in the copy
        settings = Settings(data_dir=tmp_path / "b", database_url=urls[1])
        await asyncio.to_thread(lambda: keeping.restore(settings, copy, replace=False))
        restored = await _rows(settings)
        assert restored == _rows_of_file(copy)
        assert len(restored["entries"]) == 60 + 20
        async with running(tmp_path / "b", urls[1]) as system:
            assert fingerprint((await system.caught_up()).view) == before
            await system.post(range(60, 70))
            again = fingerprint((await system.caught_up()).view)
        async with running(tmp_path / "a", urls[0]) as system:
            assert fingerprint((await system.caught_up()).view) == again


@pytest.mark.parametrize("kind", KINDS)
async def test_what_was_deleted_since_stays_deleted(tmp_path: Path, kind: str) -> None:
    copy = tmp_path / "copy.db"
    async with fresh_database(kind) as url:
        async with running(tmp_path, url) as system:
            await _fill(system)
            await asyncio.to_thread(keeping.back_up, system.settings, copy)
            await system.store.write(delete_site, "gone")
            await system.store.write(forget_robot, "other", "q")
            assert await system.store.write(remove_file, 2, "floorplan", "plan")
            await system.post(range(60, 70))
        settings = system.settings
        with pytest.raises(StoreError, match="2 sites: say that they are to be replaced"):
            await asyncio.to_thread(lambda: keeping.restore(settings, copy, replace=False))
        kept = await asyncio.to_thread(lambda: keeping.restore(settings, copy, replace=True))
        assert (kept is None) is (url is not None)
        async with running(tmp_path, url) as system:
            sites = {site.name: site for site in await system.store.sites()}
            assert sorted(sites) == ["other", "site"]
            assert sorted(sites["other"].robots) == ["r"]
            assert await system.store.read(list_files, 2, "floorplan") == []
            assert sites["site"].accepted == 60
            # A number that was given is not given again.
            await system.store.write(append_scans, "new", "r", [], processed=0, limit=1)
            assert {s.id for s in await system.store.sites()} >= {1, 2, 4}


async def test_nothing_is_restored_while_a_service_has_the_database(
    tmp_path: Path, database_url: str | None
) -> None:
    copy = tmp_path / "copy.db"
    async with running(tmp_path, database_url) as system:
        await system.post(range(3))
        await asyncio.to_thread(keeping.back_up, system.settings, copy)
        with pytest.raises(StoreError, match="service"):
            await asyncio.to_thread(lambda: keeping.restore(system.settings, copy, replace=True))
        with pytest.raises(StoreError, match="is there already"):
            await asyncio.to_thread(keeping.back_up, system.settings, copy)


def _damage(path: Path) -> None:
    """Change one byte in a scan's body, and break a page that another runs over to."""
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE entries SET body = zeroblob(length(body)) WHERE position = 4")


async def test_a_changed_entry_is_named_and_left_out_and_the_rest_goes_on(
    tmp_path: Path,
) -> None:
    async with running(tmp_path, None) as system:
        await system.post(range(60))
    _damage(system.settings.database_path)
    with sqlite3.connect(system.settings.database_path) as connection:
        connection.execute("DELETE FROM snapshots")
        connection.execute("DELETE FROM events")
    async with running(tmp_path, None) as system:
        published = await system.caught_up()
        assert (published.scans, published.skipped) == (59, 1)
        trouble = system.conductor.trouble(1)
        assert trouble == "entry 4 of its log (robot r, seq 3) is damaged and left out"
        assert not system.conductor.not_ready()
        await system.post(range(60, 70))
        assert (await system.caught_up()).scans == 69
        found = await asyncio.to_thread(keeping.inspect, system.settings)
        assert found.entries == 70
        assert found.damage == ["site site: entry 4 (robot r, seq 3) is not what was written"]


async def test_what_can_be_read_is_salvaged_and_served(tmp_path: Path) -> None:
    async with running(tmp_path, None) as system:
        await system.post(range(60))
    _damage(system.settings.database_path)
    command = ["--data-dir", str(tmp_path)]

    async def run(*words: str) -> Result:
        return await asyncio.to_thread(lambda: CliRunner().invoke(app, [*words, *command]))

    checked = await run("db", "check")
    assert checked.exit_code == 4
    assert "entry 4 (robot r, seq 3) is not what was written" in checked.stdout
    saved = tmp_path / "saved.db"
    salvaged = await run("db", "salvage", str(saved))
    assert salvaged.exit_code == 0, salvaged.output
    assert "entries: row 4" in salvaged.stdout
    assert (await run("db", "restore", str(saved))).exit_code == 1
    restored = await run("db", "restore", str(saved), "--replace")
    assert restored.exit_code == 0, restored.output
    assert "before-restore-1" in restored.stderr
    checked = await run("db", "check", "--json")
    assert checked.exit_code == 0
    async with running(tmp_path, None) as system:
        published = await system.caught_up()
        assert published.scans == 59
        (site,) = await system.store.sites()
        assert site.accepted == 59
        assert system.conductor.trouble(1) is None
        await system.post(range(60))  # the robot has it still
        assert (await system.store.sites())[0].accepted == 60
