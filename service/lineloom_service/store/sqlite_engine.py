"""Connections to a SQLite file that commit what they should, when they should."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event

_READS = "lineloom_reads"

_PRAGMAS = (
    "PRAGMA journal_mode = WAL",
    # A commit returns when it is on the disk, not when it is on its way.
    "PRAGMA synchronous = FULL",
    "PRAGMA busy_timeout = 5000",
)


def sqlite_engine(path: Path, *, foreign_keys: bool = True) -> Engine:
    """Return an engine whose every connection is durable and tolerant of a concurrent reader.

    A transaction begins with its first statement, whatever that is, changes of the schema
    included, and is the only writer's from then on.
    foreign_keys: off where tables are made anew, which SQLite cannot do one by one with them on.
    """
    engine = create_engine(
        f"sqlite:///{path}", connect_args={"check_same_thread": False}, pool_size=4
    )

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, _record: Any) -> None:
        # Python's driver begins a transaction with the first INSERT, UPDATE or DELETE only: what
        # was created or altered before is on the disk at once, without the rest of its upgrade.
        connection.isolation_level = None
        for pragma in (*_PRAGMAS, f"PRAGMA foreign_keys = {'ON' if foreign_keys else 'OFF'}"):
            connection.execute(pragma)

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        # One that read first and writes then fails at once where another process, such as
        # `lineloom token`, wrote in between; one that means to write from its start waits.
        reads = connection.get_execution_options().get(_READS, False)
        connection.exec_driver_sql("BEGIN" if reads else "BEGIN IMMEDIATE")

    return engine


@contextmanager
def reading(engine: Engine) -> Iterator[Connection]:
    """A connection for what only reads: one state of the tables, and nobody is blocked."""
    with engine.connect() as connection:
        yield connection.execution_options(**{_READS: True})
