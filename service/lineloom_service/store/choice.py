"""Which database the settings mean."""

from __future__ import annotations

from pathlib import Path

from lineloom_service.store.database import Database
from lineloom_service.store.postgres_database import PostgresDatabase
from lineloom_service.store.sqlite_database import SqliteDatabase

POSTGRES = "postgresql+asyncpg://"


def database_at(url: str | None, file: Path) -> Database:
    """Return the PostgreSQL database that `url` names; without one, the SQLite file."""
    return SqliteDatabase(file) if url is None else PostgresDatabase(url)
