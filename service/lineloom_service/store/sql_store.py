"""The store in a SQL database, the same for SQLite and PostgreSQL."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable
from typing import Concatenate, ParamSpec, TypeVar

from sqlalchemy import Connection
from sqlalchemy.exc import SQLAlchemyError

from lineloom_service.store.actions import begin_term, purge_portion
from lineloom_service.store.damage import is_damage
from lineloom_service.store.database import Claim, Database
from lineloom_service.store.failure import failure_of
from lineloom_service.store.group_commit import GroupCommit
from lineloom_service.store.ledger import Ledger
from lineloom_service.store.protocol import NEWS, CommitListener, NewsListener
from lineloom_service.store.reads import read_revision, read_term
from lineloom_service.store.records import DamagedError, SiteRecord, StoreError
from lineloom_service.store.storage_trial import told_plainly, try_storage
from lineloom_service.store.transaction import Transaction

P = ParamSpec("P")
T = TypeVar("T")

_LOG = logging.getLogger(__name__)

_FAILS_ON_S = 10.0
"""A commit that failed counts for so long, unless one has succeeded since."""

_TRIAL_S = 5.0


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
        self._purging: asyncio.Task[None] | None = None
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
        self._purge()

    async def close(self) -> None:
        """Commit what is under way and let go of the database."""
        for task in (self._purging, self._refresh):
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

    async def sites(self) -> list[SiteRecord]:
        """All sites by name."""
        await self._catch_up()
        return [self._records[name] for name in sorted(self._records)]

    async def site(self, site: str) -> SiteRecord | None:
        """One site."""
        await self._catch_up()
        return self._records.get(site)

    async def read(
        self, query: Callable[Concatenate[Connection, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Ask the database."""
        return await _guarded(
            self._database.read(lambda connection: query(connection, *args, **kwargs))
        )

    async def write(
        self, action: Callable[Concatenate[Transaction, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Act on the log, in a commit that others share."""
        return await self._writer.submit(lambda tx: action(tx, *args, **kwargs))

    async def write_as_engine(
        self, action: Callable[Concatenate[Transaction, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Act on the log as the one engine."""
        term = self._term

        def guarded(tx: Transaction) -> T:
            _check_term(tx.term, term)
            return action(tx, *args, **kwargs)

        return await self._writer.submit(guarded)

    async def write_apart(
        self, work: Callable[Concatenate[Connection, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Write what has nothing to do with the log."""
        return await _guarded(
            self._database.write(lambda connection: work(connection, *args, **kwargs))
        )

    async def write_apart_as_engine(
        self, work: Callable[Concatenate[Connection, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Write what has nothing to do with the log as the one engine."""
        term = self._term

        def guarded(connection: Connection) -> T:
            _check_term(read_term(connection), term)
            return work(connection, *args, **kwargs)

        return await self.write_apart(guarded)

    async def check(self) -> str | None:
        """Try whether scans can be taken."""
        failed = self._writer.failure
        if failed is not None and time.monotonic() - failed.at < _FAILS_ON_S:
            return f"the storage failed: {failed.why}"
        try:
            async with asyncio.timeout(_TRIAL_S):
                await self._database.check()
                await self._database.write(try_storage)
        except TimeoutError:
            return f"the storage does not answer within {_TRIAL_S:g} s"
        except Exception as error:  # whatever it is: nothing can be taken
            return f"the storage failed: {told_plainly(error)}"
        return None

    def mapper_trouble(self) -> str | None:
        """Return why no other process seems to map."""
        return self._database.mapper_trouble()

    async def claim_mapping(self, *, wait: bool) -> Claim:
        """Become the process that maps."""
        claim = await self._database.claim(wait=wait)
        self._term = await self.write(begin_term)
        return claim

    def _on_commit(self, record: SiteRecord) -> None:
        former = self._records.get(record.name)
        if not record.deleted:
            self._records[record.name] = record
        else:
            if former is not None and former.id == record.id:
                del self._records[record.name]
            self._purge()
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
        revision = await self.read(read_revision)
        if revision != self._writer.revision:
            await self._writer.refresh()

    def _purge(self) -> None:
        """Remove the rows of deleted sites, in the background."""
        if self._purging is None or self._purging.done():
            self._purging = asyncio.create_task(self._purge_deleted())

    async def _purge_deleted(self) -> None:
        with contextlib.suppress(StoreError):  # what is left goes at the next start
            while await self.write(purge_portion):
                await asyncio.sleep(0.01)


async def _guarded(result: Awaitable[T]) -> T:
    try:
        return await result
    except (SQLAlchemyError, OSError) as error:
        if is_damage(error):
            raise DamagedError("the storage is damaged: a page of it cannot be read") from error
        _LOG.exception("the database failed")
        raise failure_of(error) from error


def _check_term(current: int, mine: int) -> None:
    if current != mine:
        raise StoreError("another mapping engine has taken over this database")
