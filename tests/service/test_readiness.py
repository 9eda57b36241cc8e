"""`/readyz` says whether scans can be taken, in every state that keeps them from being taken."""

from __future__ import annotations

import asyncio
import errno
import os
import signal
import sqlite3
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from lineloom_service.app import create_app
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.observation import storage_watch
from lineloom_service.service import Service
from lineloom_service.settings import Settings
from lineloom_service.store import sql_store
from lineloom_service.store.sqlite_database import SqliteDatabase
from sqlalchemy import event, make_url, text
from sqlalchemy.ext.asyncio import create_async_engine

from tests.service.databases import POSTGRESQL, fresh_database
from tests.service.system import FAKE

SCAN = {
    "stamp": 0.0,
    "angle_min": 0.0,
    "angle_increment": 0.001,
    "range_min": 0.1,
    "range_max": 9.0,
}


class Served:
    """A service and a client of it."""

    def __init__(self, service: Service, client: httpx.AsyncClient) -> None:
        self.service = service
        self.client = client

    async def ready(self, query: str = "") -> tuple[int, dict[str, Any]]:
        response = await self.client.get(f"/readyz{query}")
        return response.status_code, response.json()

    async def post(self, seq: int, beams: int = 3, site: str = "s") -> int:
        scan = {**SCAN, "seq": seq, "ranges": [1.25] * beams}
        response = await self.client.post(f"/v1/sites/{site}/robots/r/scans", json=scan)
        return response.status_code

    async def until(self, right: Callable[[int, dict[str, Any]], object], query: str = "") -> None:
        for _ in range(2000):
            found = await self.ready(query)
            if right(*found):
                return
            await asyncio.sleep(0.01)
        raise AssertionError(f"never happened; last seen {found}")

    @property
    def database(self) -> SqliteDatabase:
        database: SqliteDatabase = self.service.store._database  # type: ignore[attr-defined]
        return database


@asynccontextmanager
async def serving(path: Path, url: str | None = None) -> AsyncIterator[Served]:
    settings = Settings(data_dir=path, database_url=url, publish_every_s=0.05)
    service = Service(settings, engine=LocalEngine(1, mapper=FAKE, warm_up=None))
    await service.start()
    transport = httpx.ASGITransport(create_app(service=service))
    try:
        async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
            served = Served(service, client)
            await served.until(lambda status, _: status == 200, "?maps=true")
            yield served
    finally:
        await service.stop()


@pytest.fixture(autouse=True)
def _looks_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage_watch, "_GOOD_FOR_S", 0.05)


def _refuses(*words: str) -> Callable[[int, dict[str, Any]], bool]:
    def right(status: int, found: dict[str, Any]) -> bool:
        told = all(word in "; ".join(found["reasons"]) for word in words)
        return status == 503 and found["takes_scans"] is False and told

    return right


def _takes(status: int, found: dict[str, Any]) -> bool:
    return status == 200 and bool(found["takes_scans"]) and bool(found["maps"])


async def test_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    async with serving(tmp_path) as served:
        assert await served.post(0) == 202
        with monkeypatch.context() as patched:
            patched.setattr(os, "posix_fallocate", full)
            await served.until(_refuses("No space left on device"))
            site = (await served.client.get("/v1/sites/s")).json()
            assert "No space left" in site["trouble"]
            figures = (await served.client.get("/metrics")).text
            assert "lineloom_takes_scans 0.0" in figures
            assert 'lineloom_trouble{site="s"} 1.0' in figures
        await served.until(_takes)
        figures = (await served.client.get("/metrics")).text
        assert "lineloom_takes_scans 1.0" in figures
        assert 'lineloom_trouble{site="s"} 0.0' in figures
        assert (await served.client.get("/v1/sites/s")).json()["trouble"] is None


async def test_a_database_that_has_no_room_for_a_scan_although_the_disk_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(tmp_path) as served:
        _limit_pages(served.database, 110)
        statuses = [await served.post(seq, 3000) for seq in range(60)]
        assert statuses[0] == 202
        assert statuses[-1] in (503, 507)
        status, found = await served.ready()
        assert _refuses("disk is full")(status, found)
        _limit_pages(served.database, 10**6)
        assert await served.post(60) == 202
        await served.until(_takes)


def _limit_pages(database: SqliteDatabase, pages: int) -> None:
    """SQLite answers "disk is full" beyond so many pages."""
    assert database._engine is not None
    database._engine.dispose()

    @event.listens_for(database._engine, "connect")
    def _limit(connection: sqlite3.Connection, _record: object) -> None:
        connection.execute(f"PRAGMA max_page_count = {pages}")


async def test_a_database_file_that_was_removed(tmp_path: Path) -> None:
    async with serving(tmp_path) as served:
        (tmp_path / "lineloom.db").rename(tmp_path / "elsewhere.db")
        await served.until(_refuses("database file was removed"))
        (tmp_path / "lineloom.db").write_bytes((tmp_path / "elsewhere.db").read_bytes())
        await served.until(_refuses("replaced"))
        (tmp_path / "elsewhere.db").rename(tmp_path / "lineloom.db")
        await served.until(_takes)


async def test_a_log_that_cannot_be_read(tmp_path: Path) -> None:
    async with serving(tmp_path) as served:
        await served.post(0)
        with (tmp_path / "lineloom.db").open("r+b") as file:
            file.write(b"\xff" * 4096)
        await served.until(_refuses("no database any more"))


async def test_a_storage_that_does_not_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sql_store, "_TRIAL_S", 0.2)
    async with serving(tmp_path) as served:
        with monkeypatch.context() as patched:
            patched.setattr(served.database, "write", lambda _: asyncio.sleep(60.0))
            await served.until(_refuses("does not answer within 0.2 s"))
        await served.until(_takes)


async def test_a_database_that_is_away(tmp_path: Path) -> None:
    async with fresh_database(POSTGRESQL) as url:
        assert url is not None
        name = make_url(url).database
        server = make_url(url).set(database="postgres")
        admin = create_async_engine(server, isolation_level="AUTOCOMMIT")
        async with serving(tmp_path, url) as served, admin.connect() as connection:
            assert await served.post(0) == 202
            await connection.execute(text(f"ALTER DATABASE {name} ALLOW_CONNECTIONS false"))
            await connection.execute(
                text(
                    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = :name"
                ),
                {"name": name},
            )
            await served.until(_refuses("the storage failed"))
            assert await served.post(1) in (503, 507)
            await connection.execute(text(f"ALTER DATABASE {name} ALLOW_CONNECTIONS true"))
            await served.until(_takes)
            assert await served.post(1) == 202
        await admin.dispose()


async def test_a_worker_that_is_gone_keeps_no_scan_from_being_taken(tmp_path: Path) -> None:
    async with serving(tmp_path) as served:
        await served.post(0)
        engine = served.service.engine
        assert isinstance(engine, LocalEngine)
        os.kill(engine.pids[0], signal.SIGKILL)
        await served.until(lambda _, found: not found["maps"])
        status, found = await served.ready()
        if not found["maps"]:  # it is replaced within a second
            assert (status, found["takes_scans"]) == (200, True)
            assert "SIGKILL" in "; ".join(found["reasons"])
        await served.until(lambda status, _: status == 200, "?maps=true")


async def test_a_broken_site_is_its_own_trouble(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(tmp_path) as served:
        await served.post(0, site="broken")
        await served.post(0, site="well")
    with sqlite3.connect(tmp_path / "lineloom.db") as connection:
        (number,) = connection.execute("SELECT id FROM sites WHERE name = 'broken'").fetchone()
        connection.execute("UPDATE events SET body = x'00' WHERE site_id = ?", (number,))
        connection.execute("UPDATE entries SET body = x'00' WHERE site_id = ?", (number,))
        connection.execute("DELETE FROM snapshots")
    async with serving(tmp_path) as served:  # ready, maps included
        for _ in range(2000):
            sites = (await served.client.get("/v1/sites")).json()["sites"]
            if sites[1]["idle"]:
                break
            await asyncio.sleep(0.01)
        assert [site["site"] for site in sites] == ["broken", "well"]
        assert sites[1]["trouble"] is None
        assert _takes(*await served.ready("?maps=true"))
