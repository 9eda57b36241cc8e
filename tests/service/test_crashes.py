"""Killed again and again at random points under load: nothing acknowledged is lost, same map."""

from __future__ import annotations

import asyncio
import importlib
import json
import os
import random
import signal
from collections.abc import Sequence
from itertools import groupby, islice
from pathlib import Path
from typing import Any

import httpx
import pytest
from lineloom_core.io.jsonl import ScanRecord, record_to_json
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.warm_up.drive import warm_up
from lineloom_lab.simulation import Fleet
from lineloom_service.engine.mapper import SITE_MAPPER, Mapper, apply, load
from lineloom_service.store.reads import read_feed, read_skips
from lineloom_service.store.records import LogEntry
from lineloom_service.store.sql_store import SqlStore
from lineloom_service.store.sqlite_database import SqliteDatabase

from tests.service.fake_server import free_port, server
from tests.service.plain_robots import Scans, Stream, drive, plain_scan
from tests.service.zygote import Forked

FAKE = "fake_mapper:FakeMapper"
STREAMS: tuple[Stream, ...] = (("alone", "r"), ("shared", "r1"), ("shared", "r2"))

_NOT_POSTED = ("robot", "truth", "odometry")


async def _disturb(
    port: int,
    process: Forked,
    rng: random.Random,
    acknowledged: dict[Stream, int],
    scan: Scans,
) -> int:
    """Send, kill some workers on the way, then the server; return the number of kills."""
    sending = asyncio.create_task(drive(port, STREAMS, acknowledged, scan=scan, pause_s=0.002))
    kills = 0
    for _ in range(rng.randrange(3)):
        await _progress(acknowledged, rng.randrange(1, 60))
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        if children:
            os.kill(int(rng.choice(children)), signal.SIGKILL)
            kills += 1
    await _progress(acknowledged, rng.randrange(1, 60))
    process.send_signal(signal.SIGKILL)
    await sending
    return kills + 1


async def _progress(acknowledged: dict[Stream, int], more: int) -> None:
    goal = sum(acknowledged.values()) + more
    for _ in range(60_000):
        if sum(acknowledged.values()) >= goal:
            return
        await asyncio.sleep(0.002)
    raise AssertionError(f"no progress beyond {acknowledged}")


async def _maps(port: int) -> dict[str, bytes]:
    """Wait until all is mapped; the map of every site and the way of every robot, as answered."""
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}/v1/sites") as client:
        for _ in range(3000):
            sites = [(await client.get(f"/{site}")).json() for site in ("alone", "shared")]
            if all(site.get("idle") for site in sites):
                break
            await asyncio.sleep(0.05)
        assert all(site["idle"] for site in sites), sites
        asked = ["alone/map", "shared/map"]
        asked += [f"{site}/robots/{robot}/trajectory" for site, robot in STREAMS]
        return {path: (await client.get(f"/{path}")).content for path in asked}


async def _post_again(port: int, logs: dict[str, list[LogEntry]], scan: Scans) -> None:
    """Send to a service that nobody disturbs what another has in its log, in that order."""
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}/v1/sites") as client:
        for site, entries in logs.items():
            for robot, run in groupby(entries, key=lambda entry: entry.robot):
                scans = [scan(entry.seq or 0) for entry in run]
                url = f"/{site}/robots/{robot}/scans"
                response = await client.post(url, json={"scans": scans})
                assert response.json()["accepted"] == len(scans)


async def _log(directory: Path) -> dict[str, list[LogEntry]]:
    store = SqlStore(SqliteDatabase(directory / "lineloom.db"), gap_window_s=9.0, max_held=100)
    await store.open()
    logs = {}
    for record in await store.sites():
        assert await store.read(read_skips, record.id) == []
        logs[record.name] = await store.read(read_feed, record.id, 0, 10**6)
    await store.close()
    return logs


def _undisturbed(mapper: str, entries: Sequence[LogEntry]) -> SiteView:
    """What a mapper makes of the log that nobody ever kills."""
    fed: Mapper = load(mapper)()
    for entry in entries:
        apply(fed, entry)
    return fed.view(settled=True)  # as it is shown when all is idle


def _run(directory: Path, mapper: str, seed: int, lives: int, scan: Scans) -> int:
    rng = random.Random(seed)
    port, kills = free_port(), 0
    acknowledged = dict.fromkeys(STREAMS, 0)
    environment = {"SERVER_MAPPER": mapper, "FAKE_MAPPER_SECONDS": "0.001"}
    for _ in range(lives):
        with server(directory / "disturbed", port, **environment) as process:
            kills += asyncio.run(_disturb(port, process, rng, acknowledged, scan))
    with server(directory / "disturbed", port, **environment) as process:
        maps = asyncio.run(_maps(port))
        process.send_signal(signal.SIGTERM)
        process.wait(60)
    logs = asyncio.run(_log(directory / "disturbed"))
    for stream, count in acknowledged.items():
        seqs = [entry.seq for entry in logs[stream[0]] if entry.robot == stream[1]]
        # In order and without a hole; one may have been stored as its answer was lost.
        assert seqs == list(range(len(seqs)))
        assert len(seqs) - count in (0, 1)
    with server(directory / "undisturbed", port, **environment):
        asyncio.run(_post_again(port, logs, scan))
        assert asyncio.run(_maps(port)) == maps
    for site, entries in logs.items():
        _expect_as_mapped(maps, site, _undisturbed(mapper, entries))
    return kills


def _expect_as_mapped(maps: dict[str, bytes], site: str, view: SiteView) -> None:
    lines = json.loads(maps[f"{site}/map"])["lines"]
    shown = [(line["id"], line["x1"], line["y1"], line["x2"], line["y2"]) for line in lines]
    assert shown == [(line.id, line.x1, line.y1, line.x2, line.y2) for line in view.lines]
    for robot, trajectory in view.trajectories.items():
        poses = json.loads(maps[f"{site}/robots/{robot}/trajectory"])["poses"]
        assert [[p["x"], p["y"], p["theta"]] for p in poses] == trajectory.poses.tolist()


def test_kills_at_random_points_lose_nothing_and_leave_the_same_map(tmp_path: Path) -> None:
    importlib.import_module("fake_mapper")  # this process feeds it as well
    assert _run(tmp_path, FAKE, seed=3, lives=2, scan=plain_scan) >= 2


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_dozens_of_kills_lose_nothing_and_leave_the_same_map(tmp_path: Path, seed: int) -> None:
    assert _run(tmp_path, FAKE, seed, lives=20, scan=plain_scan) >= 30


@pytest.mark.long
def test_the_real_map_is_bit_identical_after_dozens_of_kills(tmp_path: Path) -> None:
    warm_up()  # the workers are killed before they could have compiled anything
    assert _run(tmp_path, SITE_MAPPER, seed=5, lives=15, scan=_driven()) >= 20


def _driven() -> Scans:
    """What a robot sees on a tour of an office floor, over and over."""
    fleet = Fleet.office(seed=4, robots=1)
    recorded = [record_to_json(ScanRecord(seen.scan)) for seen in islice(fleet.scans(), 800)]

    def scan(seq: int) -> dict[str, Any]:
        body = {**recorded[seq % len(recorded)], "seq": seq, "stamp": 0.2 * seq}
        return {name: value for name, value in body.items() if name not in _NOT_POSTED}

    return scan
