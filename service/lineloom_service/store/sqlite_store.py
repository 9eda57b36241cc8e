"""The embedded store: one SQLite file, one writer, readers beside it (WAL)."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TypeVar

from sqlalchemy import Connection, Engine
from sqlalchemy.exc import SQLAlchemyError

from lineloom_service.store import actions, reads
from lineloom_service.store.database import DirectoryLock, sqlite_engine
from lineloom_service.store.group_commit import GroupCommit
from lineloom_service.store.migrate import migrate
from lineloom_service.store.protocol import CommitListener
from lineloom_service.store.records import (
    Appended,
    EventBatch,
    LogEntry,
    NewScan,
    SiteRecord,
    Skip,
    SnapshotRecord,
    StoreError,
)
from lineloom_service.store.transaction import Transaction

T = TypeVar("T")

_LOG = logging.getLogger(__name__)


class SqliteStore:
    """Implements `store.protocol.Store` on a file."""

    def __init__(self, path: Path, *, gap_window_s: float, max_held: int) -> None:
        self._path = path
        self._gap_window_s = gap_window_s
        self._max_held = max_held
        self._lock = DirectoryLock(path.parent)
        self._records: dict[str, SiteRecord] = {}
        self._listeners: list[CommitListener] = []
        self._purge: asyncio.Task[None] | None = None
        self._engine: Engine | None = None
        self._writer: GroupCommit | None = None
        self._readers: ThreadPoolExecutor | None = None

    async def open(self) -> None:
        """Lock the directory, upgrade the database, start the writer."""
        self._lock.acquire()
        try:
            await self._start()
        except BaseException:
            self._lock.release()
            raise

    async def _start(self) -> None:
        self._engine = sqlite_engine(self._path)
        await asyncio.to_thread(_upgrade, self._engine, self._path)
        self._readers = ThreadPoolExecutor(2, thread_name_prefix="lineloom-reader")
        self._writer = GroupCommit(
            self._engine, self._gap_window_s, self._max_held, self._on_commit
        )
        self._records = {record.name: record for record in await self._writer.start()}
        self._purge = asyncio.create_task(self._purge_deleted())

    async def close(self) -> None:
        """Commit what is under way and let go of the file."""
        if self._purge is not None:
            self._purge.cancel()
        if self._writer is not None:
            await self._writer.stop()
        if self._readers is not None:
            self._readers.shutdown()
        if self._engine is not None:
            self._engine.dispose()
        self._lock.release()

    def subscribe(self, listener: CommitListener) -> None:
        """Have `listener` told of every site that a commit changed."""
        self._listeners.append(listener)

    async def append_scans(
        self, site: str, robot: str, scans: Sequence[NewScan], *, processed: int, limit: int
    ) -> Appended:
        """Store scans; see the protocol."""

        def action(tx: Transaction) -> Appended:
            now = time.monotonic()
            return actions.append_scans(
                tx, site, robot, scans, processed=processed, limit=limit, now=now
            )

        return await self._write(action)

    async def set_mount(self, site: str, robot: str, mount: bytes | None) -> None:
        """Log a robot's mount."""
        await self._write(partial(actions.set_mount, site_name=site, robot_name=robot, mount=mount))

    async def forget_robot(self, site: str, robot: str) -> bool:
        """Log that a robot is to be forgotten."""
        return await self._write(partial(actions.forget_robot, site_name=site, robot_name=robot))

    async def delete_site(self, site: str) -> int | None:
        """Forget a site; its rows are removed in the background."""
        site_id = await self._write(partial(actions.delete_site, site_name=site))
        if site_id is not None:
            record = self._records.get(site)
            if record is not None and record.id == site_id:
                del self._records[site]
            if self._purge is None or self._purge.done():
                self._purge = asyncio.create_task(self._purge_deleted())
        return site_id

    async def sites(self) -> list[SiteRecord]:
        """All sites by name."""
        return [self._records[name] for name in sorted(self._records)]

    async def site(self, site: str) -> SiteRecord | None:
        """One site."""
        return self._records.get(site)

    async def read_feed(self, site_id: int, after: int, limit: int) -> list[LogEntry]:
        """Return released entries."""
        return await self._read(partial(reads.read_feed, site_id=site_id, after=after, limit=limit))

    async def record_skip(self, site_id: int, position: int, reason: str) -> Skip:
        """Note that an entry is never fed again."""
        return await self._write(
            partial(actions.record_skip, site_id=site_id, position=position, reason=reason)
        )

    async def skips(self, site_id: int) -> list[Skip]:
        """All skipped entries of a site."""
        return await self._read(partial(reads.read_skips, site_id=site_id))

    async def save_snapshot(self, site_id: int, snapshot: SnapshotRecord) -> None:
        """Keep a snapshot."""
        await self._write(partial(actions.save_snapshot, site_id=site_id, snapshot=snapshot))

    async def latest_snapshot(self, site_id: int, producer: str) -> SnapshotRecord | None:
        """Return the newest snapshot that `producer` wrote."""
        return await self._read(partial(reads.read_snapshot, site_id=site_id, producer=producer))

    async def drop_snapshot(self, site_id: int, position: int) -> None:
        """Remove an unreadable snapshot."""
        await self._write(partial(actions.drop_snapshot, site_id=site_id, position=position))

    async def append_events(self, site_id: int, batch: EventBatch, kept: int) -> None:
        """Keep the events of a published view."""
        await self._write(partial(actions.append_events, site_id=site_id, batch=batch, kept=kept))

    async def read_events(self, site_id: int, after: int, limit: int) -> list[EventBatch]:
        """Return batches of events."""
        return await self._read(
            partial(reads.read_events, site_id=site_id, after=after, limit=limit)
        )

    async def last_events(self, site_id: int) -> EventBatch | None:
        """Return the newest batch of events."""
        return await self._read(partial(reads.read_last_events, site_id=site_id))

    def _on_commit(self, record: SiteRecord) -> None:
        self._records[record.name] = record
        for listener in self._listeners:
            listener(record)

    async def _write(self, action: Callable[[Transaction], T]) -> T:
        if self._writer is None:
            raise StoreError("the storage is not open")
        return await self._writer.submit(action)

    async def _read(self, query: Callable[[Connection], T]) -> T:
        engine, readers = self._engine, self._readers
        if engine is None or readers is None:
            raise StoreError("the storage is not open")

        def run() -> T:
            with engine.connect() as connection:
                return query(connection)

        try:
            return await asyncio.get_running_loop().run_in_executor(readers, run)
        except SQLAlchemyError as error:
            _LOG.exception("a read failed")
            raise StoreError(f"the storage failed: {type(error).__name__}") from error

    async def _purge_deleted(self) -> None:
        while await self._write(actions.purge_portion):
            await asyncio.sleep(0.01)


def _upgrade(engine: Engine, path: Path) -> None:
    try:
        with engine.begin() as connection:
            migrate(connection)
    except SQLAlchemyError as error:
        raise StoreError(f"cannot use the database {path}: {error}") from error
