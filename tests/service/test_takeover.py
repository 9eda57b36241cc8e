"""A serving process is killed: another one maps on, with all that was acknowledged."""

from __future__ import annotations

import asyncio
import signal
from pathlib import Path
from typing import Any

import httpx
from lineloom_service.engine.mapper import apply
from lineloom_service.store.choice import database_at
from lineloom_service.store.records import LogEntry
from lineloom_service.store.sql_store import SqlStore

from tests.service.databases import POSTGRESQL, fresh_database
from tests.service.fake_mapper import FakeMapper
from tests.service.fake_server import free_port, server, server_process

SLOW = {"FAKE_MAPPER_SECONDS": "0.002"}


def _scan(seq: int) -> dict[str, Any]:
    return {
        "seq": seq,
        "stamp": float(seq % 500),
        "angle_min": -1.0,
        "angle_increment": 0.1,
        "range_min": 0.1,
        "range_max": 30.0,
        "ranges": [1.0 + 0.01 * (seq % 97)] * 20,
    }


async def _drive(port: int, robot: str, goal: int, acknowledged: dict[str, int]) -> None:
    """Send scans up to `goal`, or until the server is gone; count those answered 202."""
    async with httpx.AsyncClient(timeout=60.0) as client:
        url = f"http://127.0.0.1:{port}/v1/sites/s/robots/{robot}/scans"
        while acknowledged[robot] < goal:
            try:
                response = await client.post(url, json=_scan(acknowledged[robot]))
            except httpx.TransportError:
                return
            assert response.status_code == 202, response.text
            acknowledged[robot] += 1


async def _idle(port: int) -> dict[str, Any]:
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}/v1/sites") as client:
        async with asyncio.timeout(120.0):
            while not (site := (await client.get("/s")).json())["idle"]:
                await asyncio.sleep(0.05)
        return {**site, "lines": (await client.get("/s/map")).json()["lines"]}


async def _entries(path: Path, url: str | None) -> list[LogEntry]:
    store = SqlStore(database_at(url, path / "lineloom.db"), gap_window_s=9.0, max_held=100)
    await store.open()
    try:
        (record,) = await store.sites()
        assert await store.skips(record.id) == []
        return await store.read_feed(record.id, 0, 10**6)
    finally:
        await store.close()


def _expect_all_mapped(
    site: dict[str, Any], entries: list[LogEntry], acknowledged: dict[str, int]
) -> None:
    for robot, count in acknowledged.items():
        seqs = [entry.seq for entry in entries if entry.robot == robot]
        assert seqs == list(range(len(seqs)))
        assert len(seqs) - count in (0, 1)  # stored, and its answer lost with the process
    undisturbed = FakeMapper()
    for entry in entries:
        apply(undisturbed, entry)
    assert site["version"] == len(entries)
    assert [line["id"] for line in site["lines"]] == [line.id for line in undisturbed.view().lines]


async def test_a_standby_maps_on_when_the_process_that_mapped_is_killed(tmp_path: Path) -> None:
    acknowledged = {"at-first": 0, "at-second": 0}
    ports = free_port(), free_port()
    async with fresh_database(POSTGRESQL) as url:
        assert url is not None
        environment = {**SLOW, "SERVER_DATABASE_URL": url}
        with (
            server(tmp_path / "a", ports[0], **environment) as first,
            server(tmp_path / "b", ports[1], **environment),
        ):
            driving = [
                asyncio.create_task(_drive(ports[0], "at-first", 10**6, acknowledged)),
                asyncio.create_task(_drive(ports[1], "at-second", 300, acknowledged)),
            ]
            while acknowledged["at-first"] < 130 or acknowledged["at-second"] < 10:
                await asyncio.sleep(0.001)
                assert not any(task.done() for task in driving)
            first.send_signal(signal.SIGKILL)
            await asyncio.gather(*driving)
            assert acknowledged["at-second"] == 300  # whoever was left took scans all the while
            site = await _idle(ports[1])
        entries = await _entries(tmp_path, url)
    _expect_all_mapped(site, entries, acknowledged)


async def test_the_directory_of_a_killed_process_is_free_and_that_of_a_living_one_is_not(
    tmp_path: Path,
) -> None:
    acknowledged = {"r": 0}
    ports = free_port(), free_port()
    with server(tmp_path, ports[0], **SLOW) as first:
        driving = asyncio.create_task(_drive(ports[0], "r", 10**6, acknowledged))
        while acknowledged["r"] < 130:
            await asyncio.sleep(0.001)
            assert not driving.done()
        with server_process(tmp_path, ports[1]) as second:
            assert await asyncio.to_thread(second.wait, 60) == 1
        assert not driving.done()
        first.send_signal(signal.SIGKILL)
        await driving
        with server(tmp_path, ports[1]) as second:
            site = await _idle(ports[1])
            second.send_signal(signal.SIGTERM)
            assert await asyncio.to_thread(second.wait, 60) == 0
    _expect_all_mapped(site, await _entries(tmp_path, None), acknowledged)
