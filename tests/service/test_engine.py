"""Mapping survives its workers: killed, crashing, raising, restarted, the map is the same."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from contextlib import AbstractAsyncContextManager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.scan import Mount, Scan
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.engine.protocol import WorkerDiedError
from lineloom_service.store.actions import delete_site, forget_robot, set_mount
from lineloom_service.store.codec import decode_scan, encode_mount, encode_scan
from lineloom_service.store.records import SnapshotRecord
from lineloom_service.store.snapshots import read_snapshot, save_snapshot

from tests.service.system import FAKE, PRODUCER, System, fingerprint, running

RAISES, CRASHES, RAISES_ONCE, HANGS = 666.0, 667.0, 668.0, 669.0
DATABASE_URL: str | None = None
"""Set for each test: None for SQLite."""


@pytest.fixture(autouse=True)
def on_each_database(database_url: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "DATABASE_URL", database_url)


def _running(path: Path, **changes: Any) -> AbstractAsyncContextManager[System]:
    return running(path, DATABASE_URL, **changes)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[int, tuple[str, ...]]:
    """The view after scans 0..199 in a run that nothing happened to."""

    async def run() -> tuple[int, tuple[str, ...]]:
        async with running(tmp_path_factory.mktemp("undisturbed"), None) as system:
            await system.post(range(200))
            return fingerprint((await system.caught_up()).view)

    return asyncio.run(run())


def test_what_the_mapper_sees_is_what_was_posted() -> None:
    ranges = np.array([1.0, 1.1, np.nan, np.inf, -np.inf, 29.999999999])
    for values in (ranges, ranges.astype(np.float32).astype(np.float64)):
        scan = Scan.checked(
            values,
            angle_min=-1.0,
            angle_increment=0.1,
            range_min=0.1,
            range_max=30.0,
            stamp=1.5,
            seq=7,
            session="s",
            odometry=Pose(1.0, 2.0, 3.0),
        )
        again = decode_scan(encode_scan(scan), "s", 7)
        np.testing.assert_array_equal(again.ranges, scan.ranges)
        assert again.ranges.dtype == np.float64
        assert again.ranges.flags.c_contiguous
        assert (again.odometry, again.stamp, again.seq) == (Pose(1.0, 2.0, 3.0), 1.5, 7)


async def test_a_killed_worker_is_replaced_and_the_map_is_the_same(
    tmp_path: Path, undisturbed: tuple[int, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", "0.004")
    async with _running(tmp_path) as system:
        await system.post(range(200))
        for position in (20, 90, 150):
            await system.until(lambda p, at=position: p.position >= at)  # type: ignore[misc]
            os.kill(system.engine.pids[0], signal.SIGKILL)
        published = await system.caught_up()
        assert fingerprint(published.view) == undisturbed
        assert (published.scans, published.skipped) == (200, 0)
        assert system.conductor.skips(1) == []


async def test_queries_never_go_back_in_time_while_a_replay_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", "0.002")
    async with _running(tmp_path, snapshot_every=1000) as system:
        await system.post(range(100))
        await system.caught_up()
        os.kill(system.engine.pids[0], signal.SIGKILL)
        await asyncio.sleep(0.1)
        await system.post(range(100, 150))
        seen: list[int] = []
        while not seen or seen[-1] < 150:
            seen.append((await system.published()).position)
            await asyncio.sleep(0.01)
        assert seen == sorted(seen)
        assert seen[0] == 100


async def test_a_worker_that_dies_idle_is_replaced_and_the_site_answers_and_goes_on(
    tmp_path: Path, undisturbed: tuple[int, tuple[str, ...]]
) -> None:
    async with _running(tmp_path) as system:
        await system.post(range(120))
        await system.caught_up()
        os.kill(system.engine.pids[0], signal.SIGKILL)
        while not system.engine.not_ready():
            await asyncio.sleep(0.001)
        answer = None
        while answer is None:
            await asyncio.sleep(0.02)
            with contextlib.suppress(WorkerDiedError):
                answer = await system.conductor.ask(1, "localise", [])
        await system.post(range(120, 200))
        assert fingerprint((await system.caught_up()).view) == undisturbed


async def test_what_takes_a_dead_workers_place_does_not_know_its_sites(tmp_path: Path) -> None:
    engine = LocalEngine(1, mapper=FAKE, warm_up=None)
    await engine.start()
    lost: asyncio.Queue[int] = asyncio.Queue()
    engine.subscribe_deaths(lost.put_nowait)
    await engine.start_site(1, 0, None)
    os.kill(engine.pids[0], signal.SIGKILL)
    assert await lost.get() == 1
    while engine.not_ready():
        await asyncio.sleep(0.01)
    with pytest.raises(WorkerDiedError):
        await engine.feed(1, [], 0, caught_up=True)
    await engine.start_site(1, 0, None)
    await engine.feed(1, [], 0, caught_up=True)
    await engine.stop()


async def test_a_restart_goes_on_from_the_snapshot(
    tmp_path: Path, undisturbed: tuple[int, tuple[str, ...]]
) -> None:
    async with _running(tmp_path) as system:
        await system.post(range(120))
        await system.caught_up()
    async with _running(tmp_path) as system:
        published = await system.caught_up()
        assert (published.position, published.scans) == (120, 120)
        snapshot = await system.store.read(read_snapshot, 1, PRODUCER)
        assert snapshot is not None
        assert snapshot.position == 120  # saved when the first service stopped
        await system.post(range(120, 200))
        assert fingerprint((await system.caught_up()).view) == undisturbed


async def test_an_unreadable_snapshot_is_dropped_and_the_log_replayed(
    tmp_path: Path, undisturbed: tuple[int, tuple[str, ...]]
) -> None:
    async with _running(tmp_path) as system:
        await system.post(range(200))
        await system.caught_up()
        await system.store.write_as_engine(
            save_snapshot, 1, SnapshotRecord(200, 200, PRODUCER, b"rubbish")
        )
    async with _running(tmp_path) as system:
        assert fingerprint((await system.caught_up()).view) == undisturbed


async def test_a_scan_that_makes_the_mapper_raise_is_skipped_for_good(tmp_path: Path) -> None:
    async with _running(tmp_path) as system:
        await system.post(range(60), stamps={30: RAISES})
        published = await system.caught_up()
        assert (published.scans, published.skipped, published.view.version) == (59, 1, 59)
        (skip,) = system.conductor.skips(1)
        assert (skip.seq, skip.position) == (30, 31)
        assert skip.reason == "ValueError: this scan is cursed"
        before = fingerprint(published.view)
    async with _running(tmp_path) as system:
        published = await system.caught_up()
        assert fingerprint(published.view) == before
        assert (published.scans, published.skipped) == (59, 1)


async def test_a_scan_that_crashes_the_worker_is_skipped_and_the_site_goes_on(
    tmp_path: Path,
) -> None:
    async with _running(tmp_path) as system:
        await system.post(range(40), stamps={7: CRASHES})
        published = await system.caught_up()
        assert (published.scans, published.skipped) == (39, 1)
        (skip,) = system.conductor.skips(1)
        assert skip.seq == 7
        assert "SIGSEGV" in skip.reason


async def test_a_scan_on_which_the_worker_hangs_is_skipped_and_the_site_goes_on(
    tmp_path: Path,
) -> None:
    async with _running(tmp_path, entry_timeout_s=1.0) as system:
        await system.post(range(20), stamps={7: HANGS})
        published = await system.caught_up()
        assert (published.scans, published.skipped) == (19, 1)
        (skip,) = system.conductor.skips(1)
        assert skip.seq == 7
        assert "did not come back within 1 s" in skip.reason


async def test_a_failure_that_does_not_come_again_costs_no_scan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MAPPER_ONCE", str(tmp_path / "once"))
    async with _running(tmp_path) as system:
        await system.post(range(40), stamps={7: RAISES_ONCE})
        published = await system.caught_up()
        assert (published.scans, published.skipped) == (40, 0)
        assert (tmp_path / "once").exists()


async def test_mounts_and_forgetting_reach_the_mapper_in_order(tmp_path: Path) -> None:
    async with _running(tmp_path) as system:
        await system.store.write(set_mount, "site", "r", encode_mount(Mount(Pose(0.1, 0.0, 0.0))))
        await system.post(range(3))
        view = (await system.caught_up()).view
        assert view.version == 4
        assert view.robots["r"].scans_processed == 3
        await system.store.write(forget_robot, "site", "r")
        published = await system.caught_up()
        assert published.view.robots == {}
        assert (published.view.version, published.scans) == (5, 3)


async def test_an_idle_site_is_saved(tmp_path: Path) -> None:
    async with _running(tmp_path, snapshot_idle_s=0.1) as system:
        await system.post(range(5))
        await system.caught_up()
        for _ in range(3000):
            if await system.store.read(read_snapshot, 1, PRODUCER):
                break
            await asyncio.sleep(0.02)
        snapshot = await system.store.read(read_snapshot, 1, PRODUCER)
        assert snapshot is not None
        assert (snapshot.position, snapshot.scans) == (5, 5)


async def test_a_deleted_site_stops_being_mapped(tmp_path: Path) -> None:
    async with _running(tmp_path) as system:
        await system.post(range(20))
        await system.caught_up()
        assert await system.store.write(delete_site, "site") == 1
        await system.conductor.forget_site(1)
        await system.post(range(3))
        published = await system.caught_up()
        assert (published.position, published.view.version) == (3, 3)


async def test_workers_that_cannot_start_are_named_as_the_reason(tmp_path: Path) -> None:
    engine = LocalEngine(1, mapper="no_such_module:Mapper", warm_up=None)
    await engine.start()
    for _ in range(3000):
        reasons = engine.not_ready()
        if reasons and "code 1" in reasons[0]:
            break
        await asyncio.sleep(0.02)
    assert reasons == ["worker 0 is warming up again: the worker ended with code 1"]
    await engine.stop()
