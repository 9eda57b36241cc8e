"""A mapper that cannot show or save its map: the site says so, goes on, and loses nothing."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.scan import Scan
from lineloom_service.engine import site_runner
from lineloom_service.engine.conductor import Conductor
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.settings import Settings
from lineloom_service.store.actions import append_scans
from lineloom_service.store.codec import encode_scan
from lineloom_service.store.records import NewScan, SnapshotRecord, StoreError
from lineloom_service.store.snapshots import read_snapshot
from lineloom_service.store.sql_store import SqlStore
from lineloom_service.store.sqlite_database import SqliteDatabase
from lineloom_service.store.transaction import Transaction

from tests.service.system import PRODUCER

UNSEEN, UNSAVED = 670.0, 671.0
SITE = 1


@asynccontextmanager
async def _mapping(path: Path) -> AsyncIterator[tuple[SqlStore, Conductor]]:
    store = SqlStore(SqliteDatabase(path / "lineloom.db"), gap_window_s=0.1, max_held=100)
    engine = LocalEngine(1, publish_every_s=0.02, mapper="fake_mapper:FakeMapper", warm_up=None)
    conductor = Conductor(store, engine, Settings(data_dir=path, snapshot_idle_s=0.05))
    await store.open()
    await conductor.start()
    try:
        yield store, conductor
    finally:
        await conductor.stop()
        await store.close()


async def _post(store: SqlStore, seq: int, stamp: float) -> None:
    scan = Scan.checked(
        np.array([1.0, 2.0]),
        angle_min=0.0,
        angle_increment=0.1,
        range_min=0.1,
        range_max=9.0,
        stamp=stamp,
        seq=seq,
    )
    scans = [NewScan("0", seq, encode_scan(scan))]
    await store.write(append_scans, "s", "r", scans, processed=0, limit=100)


async def _until(done: Callable[[], bool]) -> None:
    async with asyncio.timeout(60.0):
        while not done():
            await asyncio.sleep(0.01)


async def _saved(store: SqlStore) -> int:
    snapshot = await store.read(read_snapshot, SITE, PRODUCER)
    return 0 if snapshot is None else snapshot.position


async def test_a_map_that_cannot_be_shown_is_told_and_is_not_restored_for_ever(
    tmp_path: Path,
) -> None:
    said = "its map after entry 2 cannot be shown: ValueError: there is nothing to see"
    async with _mapping(tmp_path) as (store, conductor):
        await _post(store, 0, 0.0)
        await _until(lambda: conductor.published(SITE).position == 1)
        await _post(store, 1, UNSEEN)
        await _until(lambda: conductor.trouble(SITE) == said)
        assert conductor.published(SITE).position == 1  # the last view stands
    async with _mapping(tmp_path) as (store, conductor):
        assert "site s is being opened" in conductor.not_ready()  # at once, and then resumed
        await _until(lambda: "site s is being opened" not in conductor.not_ready())
        await _until(lambda: not conductor.not_ready())
        assert conductor.trouble(SITE) == said
        await _post(store, 2, 2.0)
        await _until(lambda: conductor.published(SITE).position == 3)
        assert conductor.trouble(SITE) is None
        assert conductor.skips(SITE) == []
        assert conductor.published(SITE).scans == 3


async def test_a_map_that_cannot_be_saved_is_told_and_costs_no_scan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(site_runner, "_SAVE_AGAIN_S", 0.05)
    said = "its map is not saved beyond entry 0: ValueError: this cannot be saved"
    async with _mapping(tmp_path) as (store, conductor):
        await _post(store, 0, UNSAVED)
        await _until(lambda: conductor.trouble(SITE) == said)
        await _until(lambda: conductor.published(SITE).position == 1)
        await _post(store, 1, 1.0)
        await _until(lambda: conductor.trouble(SITE) is None)
        assert await _saved(store) == 2
        assert conductor.skips(SITE) == []
        await _until(lambda: conductor.published(SITE).scans == 2)


async def test_a_snapshot_that_the_disk_does_not_take_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(site_runner, "_SAVE_AGAIN_S", 0.05)
    said = "its map is not saved beyond entry 0: the storage failed: disk is full"
    async with _mapping(tmp_path) as (store, conductor):

        def full(tx: Transaction, site_id: int, record: SnapshotRecord) -> None:
            raise StoreError("the storage failed: disk is full")

        with monkeypatch.context() as full_disk:
            full_disk.setattr(site_runner, "save_snapshot", full)
            await _post(store, 0, 0.0)
            await _until(lambda: conductor.trouble(SITE) == said)
            await _post(store, 1, 1.0)
            await _until(lambda: conductor.published(SITE).position == 2)  # mapped all the same
        await _until(lambda: conductor.trouble(SITE) is None)
        assert await _saved(store) == 2
