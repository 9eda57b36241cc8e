"""Several processes on one PostgreSQL database: any takes scans and answers, one maps."""

from __future__ import annotations

import asyncio
import logging
import pickle
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from lineloom_service.app import create_app
from lineloom_service.engine import forwarding
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.service import Service
from lineloom_service.settings import Settings
from lineloom_service.store import mapping_lease, postgres_database
from lineloom_service.store.records import StoreError
from sqlalchemy import text
from sqlalchemy.ext.asyncio import create_async_engine

from tests.service.databases import POSTGRESQL, fresh_database

HOLDERS = (
    "FROM pg_locks WHERE locktype = 'advisory' AND granted"
    " AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
)


@dataclass(frozen=True)
class Process:
    """A service of its own, as far as the database can tell, and a client of it."""

    service: Service
    client: httpx.AsyncClient

    async def post(self, seqs: range, site: str = "s", robot: str = "r") -> dict[str, Any]:
        scans = [_scan(seq) for seq in seqs]
        url = f"/v1/sites/{site}/robots/{robot}/scans"
        response = await self.client.post(url, json={"scans": scans})
        assert response.status_code == 202, response.text
        answer: dict[str, Any] = response.json()
        return answer

    async def get(self, path: str) -> dict[str, Any]:
        answer: dict[str, Any] = (await self.client.get(path)).json()
        return answer

    async def idle(self, site: str = "s") -> dict[str, Any]:
        return await until(lambda: self.get(f"/v1/sites/{site}"), lambda found: found["idle"])

    async def map(self, site: str = "s") -> dict[str, Any]:
        await self.idle(site)
        return await self.get(f"/v1/sites/{site}/map")


async def until(
    look: Callable[[], Awaitable[dict[str, Any]]], right: Callable[[dict[str, Any]], Any]
) -> dict[str, Any]:
    for _ in range(3000):
        if right(found := await look()):
            return found
        await asyncio.sleep(0.02)
    raise AssertionError(f"never happened; last seen: {found}")


def _scan(seq: int) -> dict[str, Any]:
    return {
        "seq": seq,
        "stamp": float(seq),
        "angle_min": -1.0,
        "angle_increment": 0.5,
        "range_min": 0.1,
        "range_max": 30.0,
        "ranges": [1.0 + 0.01 * (seq % 7), 2.0, 3.0, 4.0, 5.0],
    }


@asynccontextmanager
async def process(url: str, path: Path, **changes: Any) -> AsyncIterator[Process]:
    values = {"gap_window_s": 0.2, "publish_every_s": 0.05, **changes}
    settings = Settings(data_dir=path, database_url=url, **values)
    engine = LocalEngine(1, publish_every_s=0.05, mapper="fake_mapper:FakeMapper", warm_up=None)
    service = Service(settings, engine=engine)
    await service.start()
    transport = httpx.ASGITransport(create_app(service=service))
    try:
        async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
            yield Process(service, client)
    finally:
        await service.stop()


@pytest_asyncio.fixture
async def url() -> AsyncIterator[str]:
    async with fresh_database(POSTGRESQL) as url:
        assert url is not None
        yield url


async def _undisturbed(path: Path, scans: int) -> dict[str, Any]:
    """The map of one undisturbed process, on SQLite."""
    settings = Settings(data_dir=path, gap_window_s=0.2, publish_every_s=0.05)
    engine = LocalEngine(1, publish_every_s=0.05, mapper="fake_mapper:FakeMapper", warm_up=None)
    service = Service(settings, engine=engine)
    await service.start()
    transport = httpx.ASGITransport(create_app(service=service))
    async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
        alone = Process(service, client)
        await alone.post(range(scans))
        found = await alone.map()
    await service.stop()
    return found


async def test_any_process_takes_scans_and_all_answer_the_same(url: str, tmp_path: Path) -> None:
    async with process(url, tmp_path) as a, process(url, tmp_path) as b:
        for start in range(0, 60, 10):
            taken = await (a, b)[start // 10 % 2].post(range(start, start + 10))
            assert taken["accepted"] == 10
        again = await b.post(range(60))
        assert (again["accepted"], again["duplicates"]) == (0, 60)
        assert await b.map() == await a.map() == await _undisturbed(tmp_path, 60)
        of_a, of_b = [await p.get("/v1/sites/s/robots/r") for p in (a, b)]
        # When something came, each process tells by its own clock.
        assert of_b.pop("last_received") == pytest.approx(of_a.pop("last_received"), abs=30.0)
        assert of_b.pop("silent_for_s") == pytest.approx(of_a.pop("silent_for_s"), abs=30.0)
        assert of_b == of_a


async def test_what_one_took_the_other_counts_at_once(url: str, tmp_path: Path) -> None:
    async with process(url, tmp_path) as a, process(url, tmp_path) as b:
        for seq in range(40):
            first, second = (a, b) if seq % 2 else (b, a)
            await first.post(range(seq, seq + 1))
            site = await second.get("/v1/sites/s")
            assert site["scans"]["accepted"] == seq + 1
            mapped = site["scans"]["processed"] == seq + 1
            assert site["idle"] is (mapped and site["settled"])


async def test_a_gap_is_filled_through_another_process(url: str, tmp_path: Path) -> None:
    async with (
        process(url, tmp_path, gap_window_s=60.0) as a,
        process(url, tmp_path, gap_window_s=60.0) as b,
    ):
        await a.post(range(5, 10))
        assert (await b.post(range(5)))["pending"] >= 5
        assert await b.map() == await _undisturbed(tmp_path, 10)


async def test_a_second_engine_that_must_map_refuses_to_start(url: str, tmp_path: Path) -> None:
    async with process(url, tmp_path):
        second = Service(Settings(data_dir=tmp_path, database_url=url, engine="require"))
        with pytest.raises(StoreError, match=r"another mapping engine .*process"):
            await second.start()
        await second.stop()


async def test_a_standby_says_so_and_takes_over_when_the_first_ends(
    url: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    async with process(url, tmp_path) as a:
        await a.post(range(30))
        await a.idle()
        async with process(url, tmp_path) as b:
            assert "another mapping engine" in caplog.text
            assert "takes scans, answers, and maps when" in caplog.text
            await until(lambda: b.get("/readyz"), lambda found: found["maps"])
            before = await b.map()
            await a.service.stop()
            assert await b.get("/v1/sites/s/map") == before
            await b.post(range(30, 60))
            assert await b.map() == await _undisturbed(tmp_path, 60)


async def test_an_engine_whose_session_ends_gives_way(url: str, tmp_path: Path) -> None:
    async with process(url, tmp_path) as a, process(url, tmp_path) as b:
        await a.post(range(20))
        await a.idle()
        admin = create_async_engine(url, isolation_level="AUTOCOMMIT")
        async with admin.connect() as connection:
            await connection.execute(text(f"SELECT pg_terminate_backend(pid) {HOLDERS}"))
        await admin.dispose()
        await b.post(range(20, 50))
        undisturbed = await _undisturbed(tmp_path, 50)
        assert await b.map() == undisturbed
        assert await a.map() == undisturbed


async def test_a_standby_takes_over_from_a_mapper_that_does_not_renew_its_lease(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mapping_lease, "RENEW_S", 0.1)
    monkeypatch.setattr(postgres_database, "LOOK_S", 0.1)
    async with process(url, tmp_path) as a, process(url, tmp_path) as b:
        await a.post(range(20))
        before = await b.map()
        await asyncio.sleep(1.5)  # a lease that is renewed stays
        assert a.service.conductor.maps
        assert (await b.get("/readyz"))["maps"]
        renewing = _postgres(a)._renewing
        assert renewing is not None
        renewing.cancel()  # as in a process that was stopped
        silent = "the process that maps (lineloom on "
        told = await until(
            lambda: b.get("/readyz?maps=true"), lambda found: silent in str(found["reasons"])
        )
        assert (told["takes_scans"], told["maps"]) == (True, False)
        assert silent in (await b.get("/v1/sites/s"))["trouble"]
        assert await b.get("/v1/sites/s/map") == before
        await until(lambda: b.get("/readyz?maps=true"), lambda found: found["maps"])
        assert b.service.conductor.maps
        await b.post(range(20, 50))
        undisturbed = await _undisturbed(tmp_path, 50)
        assert await b.map() == undisturbed
        assert await a.map() == undisturbed
        assert (await b.get("/v1/sites/s"))["trouble"] is None


async def test_that_nobody_maps_is_told(url: str, tmp_path: Path) -> None:
    async with process(url, tmp_path, engine="off") as a:
        await a.post(range(3))
        nobody = "no process maps what is taken"
        told = await until(lambda: a.get("/readyz"), lambda found: nobody in found["reasons"])
        assert (told["takes_scans"], told["maps"]) == (True, False)
        assert (await a.get("/v1/sites/s"))["trouble"] == nobody


def _postgres(process: Process) -> postgres_database.PostgresDatabase:
    database = process.service.store._database  # type: ignore[attr-defined]
    assert isinstance(database, postgres_database.PostgresDatabase)
    return database


async def test_a_process_that_never_maps_leaves_it_to_the_others(url: str, tmp_path: Path) -> None:
    async with process(url, tmp_path, engine="off") as a:
        await a.post(range(10))
        await asyncio.sleep(0.3)
        assert (await a.get("/v1/sites/s"))["scans"]["processed"] == 0
        async with process(url, tmp_path):
            assert await a.map() == await _undisturbed(tmp_path, 10)


class _Trap:
    """Runs code when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str]]:
        return exec, ("import sys; sys.trapped = True",)


@pytest.mark.parametrize("rubbish", [b"", b"rubbish", pickle.dumps(_Trap())])
async def test_a_view_that_somebody_put_into_the_database_is_told_and_ignored(
    url: str, tmp_path: Path, caplog: pytest.LogCaptureFixture, rubbish: bytes
) -> None:
    async with process(url, tmp_path) as a, process(url, tmp_path, engine="off") as b:
        await a.post(range(10))
        before = await b.map()
        admin = create_async_engine(url, isolation_level="AUTOCOMMIT")
        async with admin.connect() as connection:
            forged = text("UPDATE views SET position = position + 1, data = :data")
            await connection.execute(forged, {"data": rubbish})
            await connection.execute(text("SELECT pg_notify('lineloom', 'view 1')"))
        await admin.dispose()
        async with asyncio.timeout(60.0):
            while "unreadable view" not in caplog.text:
                await asyncio.sleep(0.02)
        assert await b.get("/v1/sites/s/map") == before
        assert not hasattr(sys, "trapped")
        await a.post(range(10, 20))
        assert await b.map() == await a.map() == await _undisturbed(tmp_path, 20)


async def test_any_process_tells_of_the_map_that_one_makes_anew(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", "0.04")
    async with process(url, tmp_path, snapshot_every=10, chunk=5) as a, process(url, tmp_path) as b:
        await b.post(range(60))
        await b.idle()
        assert (await b.get("/v1/sites/s"))["remaking"] is None
        put = await b.client.put("/v1/sites/s/config", json={"join": {"least_set": 5}})
        assert put.status_code == 200, put.text

        async def told() -> dict[str, Any]:
            site = await b.get("/v1/sites/s")
            assert (await b.get("/v1/sites"))["sites"][0].keys() == site.keys()
            return dict(site["remaking"] or {})

        found = await until(told, lambda made: made.get("position", 0) >= 10)
        assert (found["of"], found["why"]) == (61, "other parameters")
        await until(told, lambda made: not made)
        assert (await a.get("/v1/sites/s/config/difference"))["type"] == "remade"


async def test_a_site_deleted_through_one_is_gone_for_all(url: str, tmp_path: Path) -> None:
    async with process(url, tmp_path) as a, process(url, tmp_path) as b:
        await a.post(range(10))
        await b.idle()
        assert (await b.client.delete("/v1/sites/s")).status_code == 204
        assert (await a.client.get("/v1/sites/s")).status_code == 404
        await a.post(range(5))
        assert (await b.idle())["scans"]["accepted"] == 5
        assert await b.map() == await a.map()


async def test_events_reach_those_who_listen_elsewhere(url: str, tmp_path: Path) -> None:
    async with process(url, tmp_path) as a, process(url, tmp_path) as b:
        await a.post(range(5))
        await b.idle()
        path = "/v1/sites/s/events?follow=false"
        start = {"Last-Event-ID": "1-0"}

        async def told(asked: Process) -> str:
            return (await asked.client.get(path, headers=start)).text

        for _ in range(3000):
            if "event: map" in (heard := await told(b)):
                break
            await asyncio.sleep(0.02)
        assert "event: map" in heard
        assert heard == await told(a)


async def test_questions_to_the_mapper_are_answered_by_any_process(
    url: str, tmp_path: Path
) -> None:
    async with process(url, tmp_path) as a, process(url, tmp_path) as b:
        for robot in ("r1", "r2"):
            await b.post(range(3), robot=robot)
        await b.idle()
        (constraint,) = (await b.get("/v1/sites/s/constraints?state=accepted"))["constraints"]
        path = f"/v1/sites/s/constraints/{constraint['id']}"
        assert await b.get(path) == await a.get(path)
        answers = [await asked.client.post(f"{path}/what-if") for asked in (a, b)]
        assert [answer.status_code for answer in answers] == [200, 200]
        assert answers[0].json() == answers[1].json()
        retracted = (await b.client.post(f"{path}/retract")).json()
        assert retracted["state"] == "retracted"
        assert await b.map() == await a.map()


async def test_a_question_that_nobody_can_answer_says_so(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(forwarding, "_PATIENCE_S", 0.3)
    async with process(url, tmp_path) as a:
        await a.post(range(3), robot="r1")
        await a.post(range(3), robot="r2")
        await a.idle()
        (constraint,) = (await a.get("/v1/sites/s/constraints?state=accepted"))["constraints"]
    async with process(url, tmp_path, engine="off") as b:
        path = f"/v1/sites/s/constraints/{constraint['id']}"
        shown = "/v1/sites/s/constraints?state=accepted"
        await until(lambda: b.get(shown), lambda page: bool(page["constraints"]))
        answer = await b.client.post(f"{path}/what-if")
        assert answer.status_code == 503
        assert answer.json()["type"] == "/problems/not-ready"
