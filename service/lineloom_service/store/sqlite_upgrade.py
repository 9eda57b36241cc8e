"""How an older SQLite file is upgraded: all of it or nothing, wherever the process may end."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from sqlalchemy import Connection, Engine, create_engine, inspect
from sqlalchemy.exc import SQLAlchemyError

from lineloom_service.store.migrate import current_revision, is_outdated, migrate
from lineloom_service.store.records import StoreError
from lineloom_service.store.sqlite_copy import keep_copy
from lineloom_service.store.sqlite_engine import sqlite_engine

Columns = dict[str, list[str]]
"""The columns of each table, alembic's own aside."""


def upgrade_file(path: Path) -> None:
    """Create or upgrade the tables of a file, keeping a copy of an older one. Raises StoreError."""
    engine = sqlite_engine(path, foreign_keys=False)
    try:
        _upgrade(engine, path)
    except (SQLAlchemyError, sqlite3.Error, OSError) as error:
        raise StoreError(f"cannot use the database {path}: {error}") from error
    finally:
        engine.dispose()


def _upgrade(engine: Engine, path: Path) -> None:
    with engine.begin() as connection:
        revision = current_revision(connection)
        outdated = is_outdated(revision)
        new = not _columns(connection)
    known, following = _columns_from(revision) if outdated and not new else ({}, {})
    if outdated and revision is not None:
        keep_copy(path, revision, known)
    with engine.begin() as connection:
        _remove_leftovers(connection, known, following)
        migrate(connection)
        if outdated and (orphan := connection.exec_driver_sql("PRAGMA foreign_key_check").first()):
            raise StoreError(
                f"the upgrade of {path} leaves rows of {orphan[0]} without their owner"
            )


def _columns_from(revision: str | None) -> tuple[Columns, Columns]:
    """Return what a database of this revision consists of, and one of the next."""
    engine = create_engine("sqlite://")
    with engine.begin() as connection:
        if revision is not None:
            migrate(connection, revision)
        known = _columns(connection)
        migrate(connection, "+1")
        following = _columns(connection)
    engine.dispose()
    return known, following


def _columns(connection: Connection) -> Columns:
    inspector = inspect(connection)
    return {
        table: [column["name"] for column in inspector.get_columns(table)]
        for table in inspector.get_table_names()
        if table != "alembic_version"
    }


def _remove_leftovers(connection: Connection, known: Columns, following: Columns) -> None:
    """Take back the first steps of an upgrade to the revision that follows.

    Earlier versions committed a step at a time until the first one that wrote a row, and a start
    after they were killed there failed for good. Nothing was ever kept in what they had added.
    """
    found = _columns(connection)
    for table in found.keys() & following.keys() - known.keys():
        if connection.exec_driver_sql(f"SELECT count(*) FROM {table}").scalar():
            raise StoreError(
                f"the database has rows in a table {table!r} that its revision does not have: it "
                "was changed by hand, or its alembic_version was"
            )
        connection.exec_driver_sql(f"DROP TABLE {table}")
    for table in found.keys() & known.keys():
        for column in set(found[table]) & set(following[table]) - set(known[table]):
            connection.exec_driver_sql(f"ALTER TABLE {table} DROP COLUMN {column}")
