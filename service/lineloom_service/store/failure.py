"""What is the matter with the storage, in words for whoever sent something."""

from __future__ import annotations

import errno
from collections.abc import Iterator

from sqlalchemy.exc import InterfaceError, SQLAlchemyError

from lineloom_service.store.records import StorageFullError, StoreError

_FULL = {errno.ENOSPC, errno.EDQUOT}
_FULL_NAMES = ("SQLITE_FULL", "SQLITE_IOERR_SHMSIZE")
"""Of SQLite's errors: no room for the file, and none for the index of its write-ahead log."""

_FULL_STATES = ("53100",)
_AWAY_STATES = ("08", "57P")
"""Beginnings of PostgreSQL's error codes: lost connections; a server that stops or starts."""

_LONGEST = 200


def failure_of(error: BaseException) -> StoreError:
    """Return what is told of an error of the database, or of the disk below it."""
    if isinstance(error, StoreError):
        return error
    causes = list(_causes(error))
    if any(_is_full(cause) for cause in causes):
        return StorageFullError(
            "the disk that the data is on is full: nothing of the request was taken; make room, "
            "then send it again"
        )
    reason = _words(causes[-1])
    if any(_is_away(cause) for cause in causes):
        return StoreError(f"the database is out of reach: {reason}")
    return StoreError(f"the storage failed: {reason}")


def _causes(error: BaseException) -> Iterator[BaseException]:
    """Yield the error, and below SQLAlchemy's the driver's own."""
    at: BaseException | None = error
    while at is not None:
        yield at
        below = getattr(at, "orig", None)
        driver = None if below is at else below
        # asyncpg's error is the cause of the one that SQLAlchemy wraps it in.
        at = driver if driver is not None else at.__cause__ if _is_wrapped(at) else None


def _is_wrapped(error: BaseException) -> bool:
    return isinstance(error, SQLAlchemyError) or hasattr(error, "sqlstate")


def _is_full(error: BaseException) -> bool:
    if isinstance(error, OSError) and error.errno in _FULL:
        return True
    name = str(getattr(error, "sqlite_errorname", ""))
    return name in _FULL_NAMES or _state(error).startswith(_FULL_STATES)


def _is_away(error: BaseException) -> bool:
    lost = isinstance(error, ConnectionError | InterfaceError | TimeoutError)
    return lost or (isinstance(error, OSError) or _state(error).startswith(_AWAY_STATES))


def _state(error: BaseException) -> str:
    return str(getattr(error, "sqlstate", None) or "")


def _words(error: BaseException) -> str:
    """Return the driver's own words: they name no scan, no statement and no secret."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.partition(" (")[0]  # without the database's address
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0]}"[:_LONGEST] if text else type(error).__name__
