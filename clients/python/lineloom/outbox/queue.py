"""The outbox's file: an SQLite database in WAL mode.

A scan is in `queue` from the moment `put` returns until the service has said that it has it on
disk. Counters live in the same file and change in the same transaction as the queue, so that
they stay true over a `kill -9`.
"""

from __future__ import annotations

import hashlib
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgpack

from lineloom.errors import OutboxError, OutboxFullError, SequenceError
from lineloom.wire import RejectedScan, Scan

OnFull = Literal["drop-oldest", "error"]

_SCHEMA = """
CREATE TABLE IF NOT EXISTS queue (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    session TEXT NOT NULL,
    seq INTEGER NOT NULL,
    digest BLOB NOT NULL,
    body BLOB NOT NULL,
    UNIQUE (session, seq)
);
CREATE TABLE IF NOT EXISTS sessions (
    session TEXT PRIMARY KEY, last_seq INTEGER NOT NULL, last_digest BLOB NOT NULL
);
CREATE TABLE IF NOT EXISTS counters (name TEXT PRIMARY KEY, value INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS facts (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS refused (
    id INTEGER PRIMARY KEY AUTOINCREMENT, session TEXT, seq INTEGER, reason TEXT NOT NULL
);
"""
_KEPT_REFUSALS = 1000


@dataclass(frozen=True, slots=True)
class OutboxStats:
    """Counts since the file was made; put = pending + delivered + refused + dropped.

    delivered includes the scans that the service had already got (answer lost on the way).
    repeated: scans put a second time, and ignored. dropped: lost to the bound, oldest first.
    """

    pending: int
    put: int
    delivered: int
    refused: int
    dropped: int
    repeated: int


@dataclass(frozen=True, slots=True)
class Refusal:
    """A scan that the service will never take, and why."""

    session: str
    seq: int
    reason: str


@dataclass(frozen=True, slots=True)
class Queued:
    """A scan on disk."""

    id: int
    scan: Scan


class ScanQueue:
    """The queue; one robot, one file. May be shared by threads."""

    def __init__(self, path: str | Path, *, max_scans: int, on_full: OnFull, sync: bool) -> None:
        if max_scans < 1:
            raise ValueError("max_scans must be at least 1")
        self.path = Path(path)
        self._max_scans = max_scans
        self._on_full = on_full
        self._lock = threading.RLock()
        self._last: tuple[OutboxStats, list[Refusal]] | None = None
        self._in_flight_to = 0
        try:
            self._db = sqlite3.connect(
                self.path, timeout=30.0, isolation_level=None, check_same_thread=False
            )
            self._db.execute("PRAGMA journal_mode = WAL")
            # FULL: a scan survives a power cut, too. NORMAL: only the death of the process.
            self._db.execute(f"PRAGMA synchronous = {'FULL' if sync else 'NORMAL'}")
            self._db.executescript(_SCHEMA)
        except sqlite3.Error as error:
            raise OutboxError(f"{self.path} cannot be used as an outbox: {error}") from error

    def close(self) -> None:
        """Close the file; what `stats` and `refusals` said last stays known."""
        with self._lock:
            self._last = self.stats(), self.refusals()
            self._db.close()

    def fact(self, name: str, default: str) -> str:
        """Return what was noted under `name`, noting `default` where nothing was."""
        with self._transaction() as db:
            db.execute("INSERT OR IGNORE INTO facts VALUES (?, ?)", (name, default))
            row = db.execute("SELECT value FROM facts WHERE name = ?", (name,)).fetchone()
        return str(row[0])

    def next_seq(self, session: str) -> int:
        """Return the seq after the last one put in the session. Raises OutboxError once closed."""
        if self._last is not None:
            raise OutboxError(f"{self.path} is closed")
        with self._lock:
            row = self._db.execute(
                "SELECT last_seq FROM sessions WHERE session = ?", (session,)
            ).fetchone()
        return 0 if row is None else int(row[0]) + 1

    def append(self, scan: Scan) -> bool:
        """Put a scan on disk; False where it was put before.

        Raises SequenceError where another scan has this session and seq, OutboxFullError where
        the bound is reached and the policy is to refuse.
        """
        body = _pack(scan)
        digest = hashlib.blake2b(body, digest_size=16).digest()
        with self._transaction() as db:
            if self._is_repeated(scan, digest):
                self._count("repeated")
                return False
            self._make_room()
            db.execute(
                "INSERT INTO queue (session, seq, digest, body) VALUES (?, ?, ?, ?)",
                (scan.session, scan.seq, digest, body),
            )
            db.execute(
                "INSERT INTO sessions VALUES (?, ?, ?) ON CONFLICT (session) DO UPDATE "
                "SET last_seq = excluded.last_seq, last_digest = excluded.last_digest "
                "WHERE excluded.last_seq > last_seq",
                (scan.session, scan.seq, digest),
            )
            self._count("put")
        return True

    def oldest(self, count: int) -> list[Queued]:
        """Return the oldest scans, which are from now on in flight: not dropped for room."""
        with self._transaction() as db:
            rows = db.execute("SELECT id, body FROM queue ORDER BY id LIMIT ?", (count,)).fetchall()
            self._in_flight_to = rows[-1][0] if rows else 0
        return [Queued(row[0], _unpack(row[1])) for row in rows]

    def landed(self) -> None:
        """Say that nothing is in flight any more."""
        self._in_flight_to = 0

    def settle(self, sent: Sequence[Queued], rejected: Sequence[RejectedScan]) -> None:
        """Take scans off the queue that the service has answered for."""
        reasons = {refusal.index: refusal.reason for refusal in rejected}
        with self._transaction() as db:
            gone = 0
            for index, queued in enumerate(sent):
                found = db.execute("DELETE FROM queue WHERE id = ?", (queued.id,)).rowcount
                if not found:
                    continue
                if index in reasons:
                    self._refuse(queued.scan, reasons[index])
                else:
                    gone += 1
            self._count("delivered", gone)

    def refusals(self) -> list[Refusal]:
        """Return the latest refused scans, oldest first; once closed, as they were then."""
        if self._last is not None:
            return self._last[1]
        with self._lock:
            rows = self._db.execute(
                "SELECT session, seq, reason FROM refused ORDER BY id"
            ).fetchall()
        return [Refusal(*row) for row in rows]

    def stats(self) -> OutboxStats:
        """Return the counts; once closed, as they were then."""
        if self._last is not None:
            return self._last[0]
        with self._lock:
            rows = self._db.execute("SELECT name, value FROM counters").fetchall()
        counts = dict.fromkeys(("put", "delivered", "refused", "dropped", "repeated"), 0)
        counts |= dict(rows)
        # All of them change together with the queue, so nothing needs to be counted there.
        gone = counts["delivered"] + counts["refused"] + counts["dropped"]
        return OutboxStats(pending=counts["put"] - gone, **counts)

    def _is_repeated(self, scan: Scan, digest: bytes) -> bool:
        """Tell whether this very scan is queued, or was the last one put.

        Anything older was delivered and is left to the service, which knows what it has.
        """
        known = self._db.execute(
            "SELECT digest FROM queue WHERE session = ?1 AND seq = ?2 UNION ALL "
            "SELECT last_digest FROM sessions WHERE session = ?1 AND last_seq = ?2",
            (scan.session, scan.seq),
        ).fetchone()
        if known is None:
            return False
        if known[0] != digest:
            raise SequenceError(
                f"another scan with session {scan.session!r} and seq {scan.seq} was put before: "
                "count seq up, or leave it out"
            )
        return True

    def _make_room(self) -> None:
        over = self.stats().pending + 1 - self._max_scans
        if over <= 0:
            return
        if self._on_full == "error":
            raise OutboxFullError(f"{self.path} holds {self._max_scans} scans, the bound set")
        dropped = self._db.execute(
            "DELETE FROM queue WHERE id IN (SELECT id FROM queue WHERE id > ? ORDER BY id LIMIT ?)",
            (self._in_flight_to, over),
        ).rowcount
        self._count("dropped", dropped)

    def _refuse(self, scan: Scan, reason: str) -> None:
        self._db.execute(
            "INSERT INTO refused (session, seq, reason) VALUES (?, ?, ?)",
            (scan.session, scan.seq, reason),
        )
        self._db.execute(
            "DELETE FROM refused WHERE id <= (SELECT max(id) FROM refused) - ?",
            (_KEPT_REFUSALS,),
        )
        self._count("refused")

    def _count(self, name: str, by: int = 1) -> None:
        self._db.execute(
            "INSERT INTO counters VALUES (?, ?) ON CONFLICT (name) DO UPDATE "
            "SET value = value + excluded.value",
            (name, by),
        )

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            # IMMEDIATE: two processes on one file queue up here instead of failing half way.
            try:
                self._db.execute("BEGIN IMMEDIATE")
                yield self._db
                self._db.execute("COMMIT")
            except BaseException as error:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                if isinstance(error, sqlite3.Error):
                    raise OutboxError(f"{self.path}: {error}") from error
                raise


def _pack(scan: Scan) -> bytes:
    packed: bytes = msgpack.packb(
        {**scan.model_dump(exclude_none=True), "ranges": list(scan.ranges)}
    )
    return packed


def _unpack(body: bytes) -> Scan:
    fields: dict[str, Any] = msgpack.unpackb(body)
    return Scan.model_validate(fields)
