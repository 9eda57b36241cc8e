"""Backup, restore, inspection and salvage of a service's database."""

from __future__ import annotations

import asyncio
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from sqlalchemy import Connection, func, select
from sqlalchemy.exc import SQLAlchemyError

from lineloom_service.settings import Settings
from lineloom_service.store import tables
from lineloom_service.store.actions import delete_again
from lineloom_service.store.choice import database_at
from lineloom_service.store.database import ClaimedError, Work
from lineloom_service.store.directory_lock import DirectoryLock
from lineloom_service.store.inspection import Findings, inspect_all
from lineloom_service.store.migrate import current_revision, is_outdated
from lineloom_service.store.postgres_database import PostgresDatabase
from lineloom_service.store.records import StoreError
from lineloom_service.store.sql_store import SqlStore
from lineloom_service.store.sqlite_engine import reading, sqlite_engine
from lineloom_service.store.sqlite_upgrade import upgrade_file
from lineloom_service.store.tombstones import Tombstone, add_tombstones, read_tombstones
from lineloom_service.store.whole_copy import copy_all, salvage

T = TypeVar("T")


def inspect(settings: Settings) -> Findings:
    """Look for damage, whether or not a service has the database. Raises StoreError."""
    return _read(settings, inspect_all)


def back_up(settings: Settings, path: Path) -> int:
    """Write all there is into a new file, while the service goes on; return how many rows.

    Raises StoreError, and then leaves nothing.
    """
    with _new_file(path) as target:
        return _read(settings, lambda source: copy_all(source, target))


def save_what_can_be_read(settings: Settings, path: Path, lost: Callable[[str], None]) -> int:
    """Write the log as far as it is whole into a new file; return how many rows."""
    with _new_file(path) as target:
        return _read(settings, lambda source: salvage(source, target, lost))


def restore(settings: Settings, path: Path, *, replace: bool) -> Path | None:
    """Put a copy in the place of what there is; return where that is kept, None where nowhere.

    What was deleted since the copy was made stays deleted. Raises StoreError: where a service has
    the database, and where it has sites and `replace` is not said.
    """
    kept: Path | None = None
    if settings.database_url is None:
        kept, stones = _restore_file(settings.database_path, path, replace)
    else:
        stones = asyncio.run(_restore_server(settings.database_url, path, replace))
    asyncio.run(_delete_again(settings, stones))
    return kept


def _read(settings: Settings, work: Work[T]) -> T:
    """Run work on one state of the database, changing nothing."""
    try:
        if settings.database_url is not None:
            return asyncio.run(_read_server(settings.database_url, work))
        return _read_file(settings.database_path, work)
    except (SQLAlchemyError, OSError) as error:
        raise StoreError(f"the database cannot be read: {error}") from error


def _read_file(path: Path, work: Work[T]) -> T:
    if not path.exists():
        raise StoreError(f"there is no database {path}")
    engine = sqlite_engine(path)
    try:
        with reading(engine) as connection:
            _check_revision(connection, path)
            return work(connection)
    finally:
        engine.dispose()


async def _read_server(url: str, work: Work[T]) -> T:
    database = PostgresDatabase(url)

    def checked(connection: Connection) -> T:
        _check_revision(connection, "the database")
        return work(connection)

    try:
        return await database.read(checked)
    finally:
        await database.close()


def _check_revision(connection: Connection, what: object) -> None:
    revision = current_revision(connection)
    if is_outdated(revision):
        raise StoreError(f"{what} is of revision {revision}: start the service once, it upgrades")


@contextmanager
def _new_file(path: Path) -> Iterator[Connection]:
    """Make a database that appears under its name when it is whole."""
    if path.exists():
        raise StoreError(f"{path} is there already")
    unfinished = path.with_name(f"{path.name}.unfinished")
    _remove(unfinished)
    try:
        upgrade_file(unfinished)
        engine = sqlite_engine(unfinished)
        with engine.begin() as connection:
            yield connection
        engine.dispose()  # the last one to close writes all into the one file
        _sync(unfinished)
        unfinished.rename(path)
        _sync(path.parent)
    finally:
        _remove(unfinished)


def _restore_file(path: Path, copy: Path, replace: bool) -> tuple[Path | None, list[Tombstone]]:
    lock = DirectoryLock(path.parent)
    lock.acquire()
    new = path.with_name(f"{path.name}.restored")
    try:
        stones, sites = _if_readable(path) if replace else _if_there(path)
        _refuse_to_replace(sites, replace)
        _upgraded_copy(copy, new)
        engine = sqlite_engine(new)
        with engine.begin() as connection:
            missing = add_tombstones(connection, stones)
        engine.dispose()
        kept = _put_aside(path)
        new.rename(path)
        _sync(path.parent)
        return kept, missing
    finally:
        _remove(new)
        lock.release()


def _if_there(path: Path) -> tuple[list[Tombstone], int]:
    return _read_file(path, _what_counts) if path.exists() else ([], 0)


def _if_readable(path: Path) -> tuple[list[Tombstone], int]:
    """Return what counts of a database that may be damaged: that is why it is replaced."""
    try:
        return _if_there(path)
    except (StoreError, SQLAlchemyError):
        return [], 0


def _what_counts(connection: Connection) -> tuple[list[Tombstone], int]:
    sites = connection.execute(select(func.count()).select_from(tables.sites)).scalar_one()
    return read_tombstones(connection), sites


def _refuse_to_replace(sites: int, replace: bool) -> None:
    if sites and not replace:
        raise StoreError(f"the database has {sites} sites: say that they are to be replaced")


async def _restore_server(url: str, copy: Path, replace: bool) -> list[Tombstone]:
    database = PostgresDatabase(url)
    await database.open()
    upgraded = copy.with_name(f"{copy.name}.upgraded")
    try:
        await database.claim(wait=False)
        _upgraded_copy(copy, upgraded)

        def put(target: Connection) -> list[Tombstone]:
            stones, sites = _what_counts(target)
            _refuse_to_replace(sites, replace)
            _read_file(upgraded, lambda source: copy_all(source, target))
            return add_tombstones(target, stones)

        return await database.write(put)
    except ClaimedError as error:
        raise StoreError(f"a service has the database, stop it first: {error}") from error
    finally:
        _remove(upgraded)
        await database.close()


def _upgraded_copy(copy: Path, to: Path) -> None:
    """Write a copy of a copy, with the tables of this version."""
    if not copy.is_file():
        raise StoreError(f"there is no file {copy}")
    _remove(to)
    shutil.copyfile(copy, to)
    upgrade_file(to)
    for former in to.parent.glob(f"{to.name}.backup-*"):
        former.unlink()


async def _delete_again(settings: Settings, stones: list[Tombstone]) -> None:
    """Delete what came back with the copy."""
    if not stones:
        return
    database = database_at(settings.database_url, settings.database_path)
    store = SqlStore(database, gap_window_s=settings.gap_window_s, max_held=settings.max_held)
    await store.open()
    try:
        for stone in stones:
            await store.write(delete_again, stone)
    finally:
        await store.close()


def _put_aside(path: Path) -> Path | None:
    if not path.exists():
        return None
    number = 1
    while (kept := path.with_name(f"{path.name}.before-restore-{number}")).exists():
        number += 1
    for ending in ("-wal", "-shm"):
        beside = path.with_name(path.name + ending)
        if beside.exists():
            beside.rename(kept.with_name(kept.name + ending))
    path.rename(kept)
    return kept


def _remove(path: Path) -> None:
    for ending in ("", "-wal", "-shm", "-journal"):
        path.with_name(path.name + ending).unlink(missing_ok=True)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
