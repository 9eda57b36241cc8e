"""A serving process is killed: another one maps on, with all that was acknowledged."""

from __future__ import annotations

import asyncio
import signal
from pathlib import Path
from typing import Any

import httpx
import pytest
from lineloom_service.engine.mapper import apply
from lineloom_service.store.choice import database_at
from lineloom_service.store.reads import read_feed, read_skips
from lineloom_service.store.records import LogEntry
from lineloom_service.store.sql_store import SqlStore

from tests.service.databases import POSTGRESQL, fresh_database
from tests.service.fake_mapper import FakeMapper
from tests.service.fake_server import free_port, server, server_process
from tests.service.plain_robots import Stream, drive

SLOW = {"FAKE_MAPPER_SECONDS": "0.002"}


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
        assert await store.read(read_skips, record.id) == []
        return await store.read(read_feed, record.id, 0, 10**6)
    finally:
        await store.close()


def _expect_all_mapped(
    site: dict[str, Any], entries: list[LogEntry], acknowledged: dict[Stream, int]
) -> None:
    for (_, robot), count in acknowledged.items():
        seqs = [entry.seq for entry in entries if entry.robot == robot]
        assert seqs == list(range(len(seqs)))
        assert len(seqs) - count in (0, 1)  # stored, and its answer lost with the process
    undisturbed = FakeMapper()
    for entry in entries:
        apply(undisturbed, entry)
    assert site["version"] == len(entries)
    assert [line["id"] for line in site["lines"]] == [line.id for line in undisturbed.view().lines]


async def test_a_standby_maps_on_when_the_process_that_mapped_is_killed(tmp_path: Path) -> None:
    at_first, at_second = ("s", "at-first"), ("s", "at-second")
    acknowledged = {at_first: 0, at_second: 0}
    ports = free_port(), free_port()
    async with fresh_database(POSTGRESQL) as url:
        assert url is not None
        environment = {**SLOW, "SERVER_DATABASE_URL": url}
        with (
            server(tmp_path / "a", ports[0], **environment) as first,
            server(tmp_path / "b", ports[1], **environment),
        ):
            driving = [
                asyncio.create_task(drive(ports[0], [at_first], acknowledged)),
                asyncio.create_task(drive(ports[1], [at_second], acknowledged, goal=300)),
            ]
            while acknowledged[at_first] < 130 or acknowledged[at_second] < 10:
                await asyncio.sleep(0.001)
                assert not any(task.done() for task in driving)
            first.send_signal(signal.SIGKILL)
            await asyncio.gather(*driving)
            assert acknowledged[at_second] == 300  # whoever was left took scans all the while
            site = await _idle(ports[1])
        entries = await _entries(tmp_path, url)
    _expect_all_mapped(site, entries, acknowledged)


@pytest.mark.long
async def test_a_standby_maps_on_when_the_process_that_mapped_is_stopped(tmp_path: Path) -> None:
    stream = ("s", "r")
    acknowledged = {stream: 0}
    ports = free_port(), free_port()
    async with fresh_database(POSTGRESQL) as url:
        assert url is not None
        environment = {**SLOW, "SERVER_DATABASE_URL": url}
        with (
            server(tmp_path / "a", ports[0], **environment) as first,
            server(tmp_path / "b", ports[1], **environment),
        ):
            driving = asyncio.create_task(drive(ports[1], [stream], acknowledged, goal=300))
            while acknowledged[stream] < 100:
                await asyncio.sleep(0.001)
            first.send_signal(signal.SIGSTOP)
            async with asyncio.timeout(15.0):
                await driving
                site = await _idle(ports[1])
            first.send_signal(signal.SIGCONT)
            assert await _idle(ports[0]) == site
        entries = await _entries(tmp_path, url)
    _expect_all_mapped(site, entries, acknowledged)


async def test_the_directory_of_a_killed_process_is_free_and_that_of_a_living_one_is_not(
    tmp_path: Path,
) -> None:
    alone = ("s", "r")
    acknowledged = {alone: 0}
    ports = free_port(), free_port()
    with server(tmp_path, ports[0], **SLOW) as first:
        driving = asyncio.create_task(drive(ports[0], [alone], acknowledged))
        while acknowledged[alone] < 130:
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
