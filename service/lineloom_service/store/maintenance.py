"""The database for a command, beside a service that may be running on it."""

from __future__ import annotations

import asyncio
from typing import TypeVar

from sqlalchemy.exc import SQLAlchemyError

from lineloom_service.settings import Settings
from lineloom_service.store.choice import database_at
from lineloom_service.store.database import Work
from lineloom_service.store.directory_lock import DirectoryLock
from lineloom_service.store.records import StoreError
from lineloom_service.store.sqlite_engine import sqlite_engine

T = TypeVar("T")


def run_beside(settings: Settings, work: Work[T]) -> T:
    """Run work on the service's database and commit. Raises StoreError.

    Where no service has the database, it is created or upgraded first.
    """
    path = settings.database_path
    if settings.database_url is None and path.exists() and _is_served(settings):
        engine = sqlite_engine(path)
        try:
            with engine.begin() as connection:
                return work(connection)
        except SQLAlchemyError as error:
            raise StoreError(f"cannot use the database {path}: {error}") from error
        finally:
            engine.dispose()
    return asyncio.run(_run(settings, work))


def _is_served(settings: Settings) -> bool:
    lock = DirectoryLock(settings.database_path.parent)
    try:
        lock.acquire()
    except StoreError:
        return True
    lock.release()
    return False


async def _run(settings: Settings, work: Work[T]) -> T:
    database = database_at(settings.database_url, settings.database_path)
    await database.open()
    try:
        return await database.write(work)
    finally:
        await database.close()
