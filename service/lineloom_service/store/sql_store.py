"""The store in a SQL database, the same for SQLite and PostgreSQL."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Callable, Sequence
from functools import partial
from typing import TypeVar

from sqlalchemy.exc import SQLAlchemyError

from lineloom_service.security.token import TokenRecord
from lineloom_service.security.token_book import read_tokens
from lineloom_service.store import actions, files, questions, reads, snapshots
from lineloom_service.store.database import Claim, Database, Work
from lineloom_service.store.files import FileKind, FileRecord
from lineloom_service.store.group_commit import GroupCommit
from lineloom_service.store.ledger import Ledger
from lineloom_service.store.protocol import NEWS, CommitListener, NewsListener
from lineloom_service.store.records import (
    ActionKind,
    Appended,
    EventBatch,
    LogEntry,
    NewScan,
    SiteRecord,
    Skip,
    SnapshotRecord,
    StoreError,
    ViewRecord,
)
from lineloom_service.store.transaction import Transaction

T = TypeVar("T")

_LOG = logging.getLogger(__name__)


class SqlStore:
    """Implements `store.protocol.Store` on a database."""

    def __init__(
        self, database: Database, *, gap_window_s: float, max_held: int, group_limit: int = 256
    ) -> None:
        self.shared = database.shared
        self._database = database
        self._records: dict[str, SiteRecord] = {}
        self._listeners: list[CommitListener] = []
        self._news_listeners: list[NewsListener] = []
        ledger = Ledger(gap_window_s, max_held)
        self._writer = GroupCommit(database, ledger, group_limit, self._on_commit)
        self._purge: asyncio.Task[None] | None = None
        self._refresh: asyncio.Task[None] | None = None
        self._term = 0

    async def open(self) -> None:
        """Open the database, read what is known, start the writer."""
        await self._database.open()
        try:
            self._database.listen(self._on_notice)
            await self._writer.start()
        except SQLAlchemyError as error:
            await self._database.close()
            raise StoreError(f"the database cannot be read: {error}") from error
        except BaseException:
            await self._database.close()
            raise
        self._purge = asyncio.create_task(self._purge_deleted())

    async def close(self) -> None:
        """Commit what is under way and let go of the database."""
        for task in (self._purge, self._refresh):
            if task is not None:
                task.cancel()
        await self._writer.stop()
        await self._database.close()

    def subscribe(self, listener: CommitListener) -> None:
        """Have `listener` told of every site that a commit changed."""
        self._listeners.append(listener)

    def subscribe_news(self, listener: NewsListener) -> None:
        """Have `listener` told of what other processes saved."""
        self._news_listeners.append(listener)

    async def append_scans(
        self,
        site: str,
        robot: str,
        scans: Sequence[NewScan],
        *,
        processed: int,
        limit: int,
        robot_limit: int | None = None,
    ) -> Appended:
        """Store scans; see the protocol."""

        def action(tx: Transaction) -> Appended:
            now = time.monotonic()
            return actions.append_scans(
                tx,
                site,
                robot,
                scans,
                processed=processed,
                limit=limit,
                robot_limit=limit if robot_limit is None else robot_limit,
                now=now,
            )

        return await self._write(action)

    async def set_mount(self, site: str, robot: str, mount: bytes | None) -> None:
        """Log a robot's mount."""
        await self._write(partial(actions.set_mount, site_name=site, robot_name=robot, mount=mount))

    async def forget_robot(self, site: str, robot: str) -> bool:
        """Log that a robot is to be forgotten."""
        return await self._write(partial(actions.forget_robot, site_name=site, robot_name=robot))

    async def act(self, site: str, robot: str, kind: ActionKind, constraint: str) -> int | None:
        """Log what an operator does to a constraint."""
        return await self._write(
            partial(actions.act, site_name=site, robot_name=robot, kind=kind, constraint=constraint)
        )

    async def delete_site(self, site: str) -> int | None:
        """Forget a site; its rows are removed in the background."""
        site_id = await self._write(partial(actions.delete_site, site_name=site))
        if site_id is not None and (self._purge is None or self._purge.done()):
            self._purge = asyncio.create_task(self._purge_deleted())
        return site_id

    async def sites(self) -> list[SiteRecord]:
        """All sites by name."""
        await self._catch_up()
        return [self._records[name] for name in sorted(self._records)]

    async def site(self, site: str) -> SiteRecord | None:
        """One site."""
        await self._catch_up()
        return self._records.get(site)

    async def read_feed(self, site_id: int, after: int, limit: int) -> list[LogEntry]:
        """Return released entries."""
        return await self._read(partial(reads.read_feed, site_id=site_id, after=after, limit=limit))

    async def record_skip(self, site_id: int, position: int, reason: str) -> Skip:
        """Note that an entry is never fed again."""
        return await self._write_as_engine(
            partial(actions.record_skip, site_id=site_id, position=position, reason=reason)
        )

    async def skips(self, site_id: int) -> list[Skip]:
        """All skipped entries of a site."""
        return await self._read(partial(reads.read_skips, site_id=site_id))

    async def save_snapshot(self, site_id: int, snapshot: SnapshotRecord) -> None:
        """Keep a snapshot with its new chapters."""
        await self._write_as_engine(
            partial(snapshots.save_snapshot, site_id=site_id, snapshot=snapshot)
        )

    async def latest_snapshot(self, site_id: int, producer: str) -> SnapshotRecord | None:
        """Return the newest snapshot that `producer` wrote."""
        return await self._read(
            partial(snapshots.read_snapshot, site_id=site_id, producer=producer)
        )

    async def chapters(self, site_id: int, snapshot: SnapshotRecord) -> AsyncIterator[bytes]:
        """Read the chapters that a snapshot goes on from, each when it is asked for."""
        for number in range(snapshot.end):
            yield await self._read(
                partial(
                    snapshots.read_chapter,
                    site_id=site_id,
                    producer=snapshot.producer,
                    number=number,
                )
            )

    async def drop_snapshot(self, site_id: int, position: int) -> None:
        """Remove an unreadable snapshot."""
        await self._write_as_engine(
            partial(snapshots.drop_snapshot, site_id=site_id, position=position)
        )

    async def append_events(self, site_id: int, batch: EventBatch, kept: int) -> None:
        """Keep the events of a published view."""
        await self._write_as_engine(
            partial(actions.append_events, site_id=site_id, batch=batch, kept=kept)
        )

    async def read_events(self, site_id: int, after: int, limit: int) -> list[EventBatch]:
        """Return batches of events."""
        return await self._read(
            partial(reads.read_events, site_id=site_id, after=after, limit=limit)
        )

    async def last_events(self, site_id: int) -> EventBatch | None:
        """Return the newest batch of events."""
        return await self._read(partial(reads.read_last_events, site_id=site_id))

    async def save_view(self, site_id: int, view: ViewRecord) -> None:
        """Keep a view for other processes. Not by the writer: a large one delays no scans."""
        await self._write_apart(
            partial(actions.save_view, site_id=site_id, view=view, term=self._term)
        )

    async def view(self, site_id: int, after: int) -> ViewRecord | None:
        """Return the view that was saved last, unless it is not after position `after`."""
        return await self._read(partial(reads.read_view, site_id=site_id, after=after))

    async def put_file(self, site_id: int, kind: FileKind, file: FileRecord) -> bool:
        """Keep a file of a site."""
        return await self._write(partial(files.put_file, site_id=site_id, kind=kind, file=file))

    async def read_file(self, site_id: int, kind: FileKind, name: str) -> FileRecord | None:
        """Return a file with its data."""
        return await self._read(partial(files.read_file, site_id=site_id, kind=kind, name=name))

    async def files(self, site_id: int, kind: FileKind) -> list[FileRecord]:
        """Return the files of a kind."""
        return await self._read(partial(files.list_files, site_id=site_id, kind=kind))

    async def delete_file(self, site_id: int, kind: FileKind, name: str) -> bool:
        """Remove a file."""
        return await self._write(partial(files.delete_file, site_id=site_id, kind=kind, name=name))

    async def post_question(self, key: str, question: bytes) -> None:
        """Put a question."""
        await self._write_apart(partial(questions.post_question, key=key, question=question))

    async def question(self, key: str) -> bytes | None:
        """Return a question."""
        return await self._read(partial(questions.read_question, key=key))

    async def post_answer(self, key: str, answer: bytes) -> None:
        """Answer a question."""
        await self._write_apart(partial(questions.post_answer, key=key, answer=answer))

    async def take_answer(self, key: str) -> bytes | None:
        """Return an answer and forget it."""
        return await self._write_apart(partial(questions.take_answer, key=key))

    async def claim_mapping(self, *, wait: bool) -> Claim:
        """Become the process that maps."""
        claim = await self._database.claim(wait=wait)
        self._term = await self._write(actions.begin_term)
        return claim

    async def tokens(self) -> list[TokenRecord]:
        """Return all bearer tokens."""
        return await self._read(read_tokens)

    def _on_commit(self, record: SiteRecord) -> None:
        former = self._records.get(record.name)
        if not record.deleted:
            self._records[record.name] = record
        elif former is not None and former.id == record.id:
            del self._records[record.name]
        for listener in self._listeners:
            listener(record)

    def _on_notice(self, text: str) -> None:
        what, _, key = text.partition(" ")
        if what in NEWS:
            for listener in self._news_listeners:
                listener(NEWS[what], key)
            return
        # An own commit, or one seen already, is no news; lost notices may have been.
        news = what != "commit" or int(key) > self._writer.revision
        if news and (self._refresh is None or self._refresh.done()):
            self._refresh = asyncio.create_task(self._catch_up())

    async def _catch_up(self) -> None:
        """See what other processes have committed before this call."""
        if not self.shared:
            return
        revision = await self._read(reads.read_revision)
        if revision != self._writer.revision:
            await self._writer.refresh()

    async def _write(self, action: Callable[[Transaction], T]) -> T:
        return await self._writer.submit(action)

    async def _write_as_engine(self, action: Callable[[Transaction], T]) -> T:
        """Write what only the one engine may write."""
        term = self._term

        def guarded(tx: Transaction) -> T:
            actions.check_term(tx.term, term)
            return action(tx)

        return await self._write(guarded)

    async def _write_apart(self, work: Work[T]) -> T:
        """Write what has nothing to do with the log, in a transaction of its own."""
        try:
            return await self._database.write(work)
        except (SQLAlchemyError, OSError) as error:
            raise StoreError(f"the storage failed: {type(error).__name__}") from error

    async def _read(self, query: Work[T]) -> T:
        try:
            return await self._database.read(query)
        except (SQLAlchemyError, OSError) as error:
            _LOG.exception("a read failed")
            raise StoreError(f"the storage failed: {type(error).__name__}") from error

    async def _purge_deleted(self) -> None:
        while await self._write(actions.purge_portion):
            await asyncio.sleep(0.01)
