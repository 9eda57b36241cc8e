"""Tries whether a database takes what comes: by writing something, and taking it away again."""

from __future__ import annotations

import os

from sqlalchemy import Connection, delete, insert, select
from sqlalchemy.exc import DBAPIError

from lineloom_service.store import tables
from lineloom_service.store.records import StoreError

_SIZE = 16 * 1024
_KEY = "trial"


def try_storage(connection: Connection) -> None:
    """Read what every commit reads, and write a little, in a transaction of its own.

    What is written needs room that is not there yet, as scans do, and leaves nothing behind.
    """
    connection.execute(select(tables.clock)).one()
    connection.execute(select(tables.sites.c.name)).all()
    key = f"{_KEY}-{os.urandom(8).hex()}"
    connection.execute(insert(tables.questions).values(id=key, question=os.urandom(_SIZE)))
    connection.execute(delete(tables.questions).where(tables.questions.c.id == key))


def told_plainly(error: BaseException) -> str:
    """Return in a few words what a database said, for those who need not know its address."""
    if isinstance(error, DBAPIError) and type(error.orig).__module__ == "sqlite3":
        return str(error.orig)
    if isinstance(error, StoreError):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    found = error.orig if isinstance(error, DBAPIError) and error.orig is not None else error
    return type(found).__name__
