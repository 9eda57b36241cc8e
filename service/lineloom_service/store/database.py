"""Where the tables are, as the store sees it: SQLite or PostgreSQL behind the same few calls."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

from sqlalchemy import Connection

T = TypeVar("T")

Work = Callable[[Connection], T]
"""Plain synchronous SQLAlchemy, so that the same lines serve every kind of database."""

NoticeListener = Callable[[str], None]
"""Called on the event loop with what another process on this database says it did."""


@dataclass(frozen=True, slots=True)
class Claim:
    """The right to map what is in the database. lost: set when it is somebody else's to take."""

    lost: asyncio.Event = field(default_factory=asyncio.Event)


class ClaimedError(Exception):
    """Another mapping engine has the database."""


class Database(Protocol):
    """Runs work on connections. Errors of SQLAlchemy pass through.

    shared: other processes may use the same database at the same time.
    """

    shared: bool

    async def open(self) -> None:
        """Connect, and create or upgrade the tables. Raises StoreError."""
        ...

    async def close(self) -> None:
        """Disconnect."""
        ...

    async def read(self, work: Work[T]) -> T:
        """Run work that changes nothing, on one consistent state of the tables."""
        ...

    async def write(self, work: Work[T]) -> T:
        """Run work within a transaction; it is on disk when this returns."""
        ...

    def listen(self, listener: NoticeListener) -> None:
        """Have `listener` told of `notify`; of an empty text where notices may have been lost."""
        ...

    async def check(self) -> None:
        """Look whether there is room for more where the tables are. Raises StoreError, OSError."""
        ...

    def mapper_trouble(self) -> str | None:
        """Return why nobody seems to map what is here; None where somebody does."""
        ...

    async def claim(self, *, wait: bool) -> Claim:
        """Become the only one who maps. Raises ClaimedError where another is and we do not wait."""
        ...


def notify(connection: Connection, text: str) -> None:
    """Tell the other processes once the transaction is committed; nobody where none can be."""
    if connection.dialect.name == "postgresql":
        connection.exec_driver_sql("SELECT pg_notify('lineloom', $1)", (text,))
