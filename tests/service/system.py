"""Store, engine and conductor with the fake mapper, as the service puts them together."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.digest import digest
from lineloom_core.scan import Scan
from lineloom_service.engine.conductor import Conductor
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.engine.published import Published
from lineloom_service.events.hub import EventHub
from lineloom_service.events.recorder import EventRecorder
from lineloom_service.settings import Settings
from lineloom_service.store.actions import append_scans
from lineloom_service.store.choice import database_at
from lineloom_service.store.codec import encode_scan
from lineloom_service.store.records import NewScan
from lineloom_service.store.sql_store import SqlStore

FAKE = "fake_mapper:FakeMapper"
PRODUCER = f"{digest(MapperConfig())}@0"
"""What snapshots are keyed by."""


def new_scan(seq: int, stamp: float | None = None) -> NewScan:
    """The same for the same `seq` at any time."""
    rng = np.random.default_rng(seq)
    scan = Scan.checked(
        rng.uniform(0.5, 20.0, 20),
        angle_min=-1.0,
        angle_increment=0.1,
        range_min=0.1,
        range_max=30.0,
        stamp=float(seq) if stamp is None else stamp,
        seq=seq,
    )
    return NewScan("0", seq, encode_scan(scan))


class System:
    """A service without its web side."""

    def __init__(
        self, path: Path, database_url: str | None, *, records: bool = False, **changes: object
    ) -> None:
        values: dict[str, object] = {
            "data_dir": path,
            "database_url": database_url,
            "gap_window_s": 0.1,
            "chunk": 8,
            "publish_every_s": 0.05,
            "snapshot_every": 50,
            "snapshot_idle_s": 60.0,
        }
        self.settings = Settings.model_validate({**values, **changes})
        self.store = SqlStore(
            database_at(self.settings.database_url, self.settings.database_path),
            gap_window_s=self.settings.gap_window_s,
            max_held=100,
        )
        self.engine = LocalEngine(
            1,
            publish_every_s=self.settings.publish_every_s,
            patience_s=self.settings.entry_timeout_s,
            mapper=FAKE,
            warm_up=None,
        )
        self.hub = EventHub()
        recorder = EventRecorder(self.store, self.hub, 1000) if records else None
        self.conductor = Conductor(self.store, self.engine, self.settings, recorder)

    async def post(self, seqs: range, *, stamps: dict[int, float] | None = None) -> None:
        scans = [new_scan(seq, (stamps or {}).get(seq)) for seq in seqs]
        await self.store.write(append_scans, "site", "r", scans, processed=0, limit=10**9)

    async def published(self) -> Published:
        record = await self.store.site("site")
        assert record is not None
        return self.conductor.published(record.id)

    async def until(self, done: Callable[[Published], bool]) -> Published:
        for _ in range(6000):
            published = await self.published()
            if done(published):
                return published
            await asyncio.sleep(0.01)
        raise AssertionError(f"never happened; last seen {published.position}")

    async def caught_up(self) -> Published:
        record = await self.store.site("site")
        assert record is not None
        end = record.position
        return await self.until(lambda p: p.position >= end)


@asynccontextmanager
async def running(
    path: Path, database_url: str | None, *, records: bool = False, **changes: object
) -> AsyncIterator[System]:
    """A system that is started, and in the end stopped."""
    async with started(System(path, database_url, records=records, **changes)) as system:
        yield system


@asynccontextmanager
async def started(system: System) -> AsyncIterator[System]:
    """Start a system, and in the end stop it."""
    await system.store.open()
    await system.conductor.start()
    try:
        yield system
    finally:
        await system.conductor.stop()
        await system.store.close()


def fingerprint(view: SiteView) -> tuple[int, tuple[str, ...]]:
    """What differs as soon as one bit of what the mapper was fed does."""
    return view.version, tuple(line.id for line in view.lines)
