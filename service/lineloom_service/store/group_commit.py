"""One writer, many requests, one fsync: whatever is asked for during a commit shares the next."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from sqlalchemy import Connection, select

from lineloom_service.store import tables
from lineloom_service.store.actions import release_due
from lineloom_service.store.database import Database, notify
from lineloom_service.store.failure import failure_of
from lineloom_service.store.ledger import Ledger
from lineloom_service.store.protocol import CommitListener
from lineloom_service.store.records import BacklogFullError, SiteRecord, StoreError
from lineloom_service.store.storage_trial import told_plainly
from lineloom_service.store.transaction import Transaction

T = TypeVar("T")
Action = Callable[[Transaction], T]

_LOG = logging.getLogger(__name__)
_RETRY_S = 1.0


_CLOCK = select(tables.clock)
_LOCK_CLOCK = _CLOCK.with_for_update()


@dataclass(slots=True)
class _Job:
    """action: None for one that only wants to know what others have changed."""

    action: Action[Any] | None
    answer: asyncio.Future[Any]


@dataclass(slots=True)
class _Outcome:
    """What a commit did: each job's result or refusal, the sites that are not as before.

    failed: why some or all of it is not on the disk.
    """

    results: list[Any] = field(default_factory=list)
    records: list[SiteRecord] = field(default_factory=list)
    deadline: float | None = None
    revision: int = -1
    failed: Exception | None = None


@dataclass(frozen=True, slots=True)
class Failure:
    """A commit that failed. at: when, monotonic [s]."""

    at: float
    why: str


class GroupCommit:
    """Runs actions in the order submitted, many per database transaction.

    Also the clock of the gap window: it wakes up by itself when a held scan must go out.
    """

    def __init__(
        self, database: Database, ledger: Ledger, limit: int, listener: CommitListener
    ) -> None:
        """limit: actions that share a transaction at most."""
        self._database = database
        self._listener = listener
        self._jobs: deque[_Job] = deque()
        self._wake = asyncio.Event()
        self._closing = False
        self._deadline: float | None = None
        self._ledger = ledger
        self._limit = limit
        self._task: asyncio.Task[None] | None = None
        self.revision = -1
        """The clock's, up to which the listener has been told of everything."""
        self.failure: Failure | None = None
        """Of the last commit that had something to write; None where it went well."""

    async def start(self) -> None:
        """Read the ledger, telling the listener of all sites, and start."""
        self._closing = False
        outcome = await self._commit([None])
        self._tell(outcome)
        # Whatever waits in the log may be due already.
        self._deadline = time.monotonic()
        self._task = asyncio.create_task(self._run(), name="lineloom-group-commit")

    async def stop(self) -> None:
        """Commit what was submitted, then end."""
        self._closing = True
        self._wake.set()
        if self._task is not None:
            await self._task

    async def submit(self, action: Action[T]) -> T:
        """Run an action; returns when its commit is on the disk."""
        answer: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        self._submit(_Job(action, answer))
        return await answer

    async def refresh(self) -> None:
        """Catch up with what other processes have changed."""
        answer: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._submit(_Job(None, answer))
        await answer

    def _submit(self, job: _Job) -> None:
        if self._closing:
            raise StoreError("the service is stopping")
        self._jobs.append(job)
        self._wake.set()

    async def _run(self) -> None:
        while self._jobs or not self._closing:
            await self._wait()
            jobs = [self._jobs.popleft() for _ in range(min(len(self._jobs), self._limit))]
            try:
                outcome = await self._commit([job.action for job in jobs])
            except Exception as error:
                _LOG.exception("nothing was committed")
                self._deadline = time.monotonic() + _RETRY_S
                failure = failure_of(error)
                outcome = _Outcome([failure] * len(jobs), [], self._deadline, failed=error)
            if outcome.failed is not None:
                self.failure = Failure(time.monotonic(), told_plainly(outcome.failed))
            elif any(job.action is not None for job in jobs):
                self.failure = None
            self._deadline = outcome.deadline
            self._tell(outcome)
            for job, result in zip(jobs, outcome.results, strict=True):
                _answer(job.answer, result)

    async def _wait(self) -> None:
        while not self._jobs and not self._closing:
            self._wake.clear()
            pause = None if self._deadline is None else self._deadline - time.monotonic()
            if pause is not None and pause <= 0:
                return
            try:
                async with asyncio.timeout(pause):
                    await self._wake.wait()
            except TimeoutError:
                return

    def _tell(self, outcome: _Outcome) -> None:
        for record in outcome.records:
            try:
                self._listener(record)
            except Exception:  # what is committed is committed, and the next ones wait
                _LOG.exception("site %s: a commit was not followed", record.name)
        self.revision = max(self.revision, outcome.revision)

    async def _commit(self, actions: list[Action[Any] | None]) -> _Outcome:
        try:
            return await self._commit_together(actions)
        except Exception:
            self._distrust_ledger()
            if len(actions) <= 1:
                raise
            _LOG.exception("a group commit failed: its requests go one by one")
        outcome = _Outcome()
        for action in actions:
            try:
                alone = await self._commit_together([action])
            except Exception as error:
                self._distrust_ledger()
                outcome.results.append(failure_of(error))
                outcome.failed = error
            else:
                outcome.results += alone.results
                outcome.records += alone.records
                outcome.deadline = alone.deadline
                outcome.revision = alone.revision
        return outcome

    def _distrust_ledger(self) -> None:
        """It may have what the database does not: have it read anew."""
        self._ledger.revision = -1

    async def _commit_together(self, actions: list[Action[Any] | None]) -> _Outcome:
        if actions and all(action is None for action in actions):
            return await self._database.read(lambda connection: self._look(connection, actions))
        return await self._database.write(lambda connection: self._act(connection, actions))

    def _look(self, connection: Connection, actions: list[Action[Any] | None]) -> _Outcome:
        """Only catch up with what others have changed."""
        clock = connection.execute(_CLOCK).one()
        records = self._ledger.catch_up(connection, clock.revision, time.monotonic())
        return self._outcome([None] * len(actions), records)

    def _act(self, connection: Connection, actions: list[Action[Any] | None]) -> _Outcome:
        clock = connection.execute(_LOCK_CLOCK).one()
        now = time.monotonic()
        records = self._ledger.catch_up(connection, clock.revision, now)
        tx = Transaction(connection, self._ledger, clock.term, now)
        results: list[Any] = []
        for action in actions:
            try:
                results.append(None if action is None else action(tx))
            except (BacklogFullError, StoreError) as refusal:
                results.append(refusal)
        release_due(tx)
        tx.flush()
        if self._ledger.revision != clock.revision:
            notify(connection, f"commit {self._ledger.revision}")
        records += [site.record(deleted=True) for site in tx.gone]
        records += [site.record() for site in tx.touched.values()]
        return self._outcome(results, records)

    def _outcome(self, results: list[Any], records: list[SiteRecord]) -> _Outcome:
        return _Outcome(results, records, self._ledger.next_deadline(), self._ledger.revision)


def _answer(answer: asyncio.Future[Any], result: Any) -> None:
    if answer.done():  # the client went away while its commit ran
        return
    if isinstance(result, Exception):
        answer.set_exception(result)
    else:
        answer.set_result(result)
