"""Which of a database's errors mean that what it holds is damaged, and not that it is away."""

from __future__ import annotations

import sqlite3

from sqlalchemy.exc import DBAPIError

_SQLITE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_POSTGRESQL = ("XX001", "XX002")
"""data_corrupted, index_corrupted."""


def is_damage(error: BaseException) -> bool:
    """Whether an error says that some page or row is not what it was."""
    if not isinstance(error, DBAPIError):
        return False
    found = error.orig
    if isinstance(found, sqlite3.Error):
        # Extended codes have the kind in their lowest byte.
        return getattr(found, "sqlite_errorcode", 0) & 0xFF in _SQLITE
    return getattr(found, "sqlstate", None) in _POSTGRESQL
