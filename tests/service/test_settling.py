"""A map that nothing comes to any more settles: once, for good, and in every process."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
from lineloom import wire
from lineloom_service.app import create_app
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.service import Service
from lineloom_service.settings import Settings

SITE = "/v1/sites/s"
QUIET_S = 0.4


@asynccontextmanager
async def _served(path: Path, quiet_s: float = QUIET_S) -> AsyncIterator[httpx.AsyncClient]:
    settings = Settings(data_dir=path, gap_window_s=0.1, snapshot_idle_s=0.05)
    engine = LocalEngine(
        1,
        publish_every_s=0.05,
        settle_after_s=quiet_s,
        mapper="fake_mapper:FakeMapper",
        warm_up=None,
    )
    service = Service(settings, engine=engine)
    await service.start()
    transport = httpx.ASGITransport(create_app(service=service))
    try:
        async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
            yield client
    finally:
        await service.stop()


async def _post(client: httpx.AsyncClient, seq: int) -> None:
    scan = {
        **{"seq": seq, "stamp": float(seq), "angle_min": -1.0, "angle_increment": 0.5},
        **{"range_min": 0.1, "range_max": 30.0, "ranges": [1.0, 2.0, 3.0, 4.0, 5.0]},
    }
    response = await client.post(f"{SITE}/robots/r/scans", json={"scans": [scan]})
    assert response.status_code == 202


async def _polled(client: httpx.AsyncClient, path: str, until: tuple[int, bool]) -> list[Any]:
    """Poll with If-None-Match until a stage and some time longer: all answers that were sent."""
    answers: list[Any] = []
    etag, after = "", 0
    async with asyncio.timeout(60.0):
        while after < 20:
            found = await client.get(path, headers={"If-None-Match": etag})
            if found.status_code == 200:
                answers.append(found.json())
                etag = found.headers["ETag"]
                assert ("settled" in etag) is _stage(answers[-1])[1]
            after += bool(answers) and _stage(answers[-1]) >= until
            await asyncio.sleep(0.02)
    return answers


def _stage(answer: dict[str, Any]) -> tuple[int, bool]:
    about = answer.get("graph", answer)
    return about["version"], about["settled"]


async def _stream(client: httpx.AsyncClient) -> list[wire.AnyEvent]:
    from_the_first = {"Last-Event-ID": "1-0"}
    text = (await client.get(f"{SITE}/events?follow=false", headers=from_the_first)).text
    data = [line.removeprefix("data: ") for line in text.splitlines() if line.startswith("data: {")]
    return [wire.Event.model_validate_json(line).root for line in data]


async def test_who_polls_gets_the_settled_map_exactly_once(tmp_path: Path) -> None:
    async with _served(tmp_path) as client:
        await _post(client, 0)
        await _polled(client, f"{SITE}/map", (1, True))
        await _post(client, 1)
        polled = await asyncio.gather(
            *(_polled(client, f"{SITE}/{part}", (2, True)) for part in ("map", "graph"))
        )
        for answers in polled:
            # Also where snapshots are saved meanwhile: what is shown never goes back.
            stages = [_stage(answer) for answer in answers]
            assert stages in ([(1, True), (2, False), (2, True)], [(2, False), (2, True)])
        site = (await client.get(SITE)).json()
        assert (site["settled"], site["idle"]) == (True, True)
        for path in (f"{SITE}/robots", f"{SITE}/robots/r", f"{SITE}/constraints"):
            assert (await client.get(path)).json()["settled"] is True
        for path in (f"{SITE}/robots/r/trajectory", f"{SITE}/transforms/r/r"):
            assert (await client.get(path)).json()["settled"] is True


async def test_it_settles_only_where_nothing_comes(tmp_path: Path) -> None:
    async with _served(tmp_path) as client:
        for seq in range(15):
            began = time.monotonic()
            await _post(client, seq)
            while (site := (await client.get(SITE)).json())["version"] <= seq:
                await asyncio.sleep(0.01)
            assert not site["settled"] or time.monotonic() - began > QUIET_S
        answers = await _polled(client, f"{SITE}/map", (15, True))
        assert answers[-1]["version"] == 15


async def test_an_export_is_settled_however_busy_the_site(tmp_path: Path) -> None:
    async with _served(tmp_path, quiet_s=600.0) as client:
        await _post(client, 0)
        async with asyncio.timeout(30.0):
            while (await client.get(SITE)).json()["version"] < 1:
                await asyncio.sleep(0.01)
        assert (await client.get(f"{SITE}/map")).json()["settled"] is False
        made = (await client.post(f"{SITE}/exports", json={"format": "json"})).json()
        content = (await client.get(made["url"])).json()
        assert (made["settled"], content["settled"], content["version"]) == (True, True, 1)


async def test_that_it_settled_is_told_once_also_across_restarts(tmp_path: Path) -> None:
    async with _served(tmp_path) as client:
        await _post(client, 0)
        before = await _polled(client, f"{SITE}/map", (1, True))
        told = await _stream(client)
    async with _served(tmp_path) as client:
        after = await _polled(client, f"{SITE}/map", (1, True))
        # As it was answered before, and not unsettled first.
        assert [_stage(a) for a in after if a["version"]] == [(1, True)]
        assert after[-1] == before[-1]
        assert await _stream(client) == told
        await _post(client, 1)
        await _polled(client, f"{SITE}/map", (2, True))
        heard = [e for e in await _stream(client) if isinstance(e, wire.MapEvent)]
    assert [(e.version, e.settled) for e in heard if e.settled] == [(1, True), (2, True)]
    assert not any(isinstance(e, wire.ResetEvent) for e in told)
