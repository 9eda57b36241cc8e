"""A PostgreSQL database, which several processes may share."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from typing import Any, TypeVar

from sqlalchemy import Connection, text
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.ext.asyncio import AsyncConnection, AsyncEngine, create_async_engine

from lineloom_service.store.database import Claim, ClaimedError, NoticeListener, Work
from lineloom_service.store.mapping_lease import (
    LOOK_S,
    MAPPING_LOCK,
    HolderWatch,
    look_for_holder,
    renew,
)
from lineloom_service.store.migrate import migrate
from lineloom_service.store.records import StoreError

T = TypeVar("T")

_LOG = logging.getLogger(__name__)

_UPGRADE_LOCK = 0x4C4C_0001
"""An advisory lock; it counts within one database and ends with the transaction."""

_POOL_SIZE = 8
_AGAIN_S = 1.0
_LOST = (SQLAlchemyError, OSError)


class PostgresDatabase:
    """Implements `store.database.Database` on a server, by asyncpg."""

    shared = True

    def __init__(self, url: str) -> None:
        # The name shows in pg_stat_activity, and tells others who maps.
        name = f"lineloom on {socket.gethostname()}, process {os.getpid()}"
        settings = {"application_name": name[:63], "synchronous_commit": "on"}
        self._engine: AsyncEngine = create_async_engine(
            url, pool_size=_POOL_SIZE, connect_args={"server_settings": settings, "timeout": 10}
        )
        # All statements of a read see one state of the tables.
        self._reads = self._engine.execution_options(isolation_level="REPEATABLE READ")
        self._listeners: list[NoticeListener] = []
        self._listening: asyncio.Task[None] | None = None
        self._holding: AsyncConnection | None = None
        self._renewing: asyncio.Task[None] | None = None
        self._watching: asyncio.Task[None] | None = None
        self._holder = HolderWatch()
        self._waits = False

    async def open(self) -> None:
        """Upgrade the tables, one process at a time, and listen."""
        try:
            await self.write(_upgrade)
        except _LOST as error:
            await self._engine.dispose()
            where = self._engine.url.render_as_string(hide_password=True)
            raise StoreError(f"cannot use the database {where}: {_first_line(error)}") from error
        self._listening = asyncio.create_task(self._listen(), name="lineloom-listen")
        self._watching = asyncio.create_task(self._watch_holder(), name="lineloom-watch-lease")

    async def close(self) -> None:
        """Disconnect; the right to map, if it was ours, is free."""
        tasks = [task for task in (self._listening, self._watching) if task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await self._let_go()
        await self._engine.dispose()

    async def read(self, work: Work[T]) -> T:
        """Run work on a state of the tables that does not change meanwhile."""
        async with self._reads.connect() as connection:
            return await connection.run_sync(work)

    async def write(self, work: Work[T]) -> T:
        """Run work and commit."""
        async with self._engine.begin() as connection:
            return await connection.run_sync(work)

    def listen(self, listener: NoticeListener) -> None:
        """Have `listener` told of notices."""
        self._listeners.append(listener)

    async def claim(self, *, wait: bool) -> Claim:
        """Take the lock of the one who maps, in a session that holds it from then on."""
        self._waits = wait
        try:
            while True:
                try:
                    return await self._claim(wait)
                except _LOST as error:
                    if not wait:
                        raise StoreError(f"the storage failed: {_first_line(error)}") from error
                    _LOG.warning("the database is out of reach: %s", _first_line(error))
                    await asyncio.sleep(_AGAIN_S)
        finally:
            self._waits = False

    def mapper_trouble(self) -> str | None:
        """Return why nobody seems to map, as the last look found it; not for the one who maps."""
        return self._holder.trouble

    async def check(self) -> None:
        """Its place is the server's business."""

    async def _claim(self, wait: bool) -> Claim:
        await self._let_go()
        session = await self._own_session()
        try:
            if wait:
                await session.execute(text(f"SELECT pg_advisory_lock({MAPPING_LOCK})"))
            else:
                tried = await session.execute(text(f"SELECT pg_try_advisory_lock({MAPPING_LOCK})"))
                if not tried.scalar_one():
                    holder = await look_for_holder(session)
                    name = "unknown" if holder is None else holder.name
                    raise ClaimedError(
                        f"another mapping engine ({name}) has this database; there can be one"
                    )
        except BaseException:
            await _end(session)
            raise
        claim = Claim()
        await _on_end(session, claim.lost)
        self._holding = session
        self._renewing = asyncio.create_task(renew(session, claim), name="lineloom-renew-lease")
        return claim

    async def _let_go(self) -> None:
        session, self._holding = self._holding, None
        if self._renewing is not None:
            self._renewing.cancel()
            await asyncio.gather(self._renewing, return_exceptions=True)
        if session is not None:
            await _end(session)

    async def _watch_holder(self) -> None:
        """Know who maps; while this process waits for its turn, end one that is silent."""
        while True:
            await asyncio.sleep(LOOK_S)
            if self._holding is not None:
                continue
            try:
                async with self._engine.connect() as session:
                    self._holder.see(await look_for_holder(session))
                    if self._waits:
                        await self._holder.end_silent(session)
            except Exception as error:  # not to be reached: others tell
                _LOG.debug("who maps is not known: %s", _first_line(error))

    async def _own_session(self) -> AsyncConnection:
        """Return a connection that stays out of the pool, and out of any transaction."""
        connection = await self._engine.connect()
        return await connection.execution_options(isolation_level="AUTOCOMMIT")

    async def _listen(self) -> None:
        """Hand on notices for as long as the process runs, through any loss of the connection."""
        while True:
            try:
                session = await self._own_session()
                try:
                    ended = asyncio.Event()
                    await _on_end(session, ended)
                    raw = (await session.get_raw_connection()).driver_connection
                    assert raw is not None
                    await raw.add_listener("lineloom", lambda *notice: self._tell(notice[-1]))
                    self._tell("")  # whatever was said before nobody heard
                    await ended.wait()
                finally:
                    await _end(session)
            except _LOST as error:
                _LOG.warning("no notices from the database: %s", _first_line(error))
            await asyncio.sleep(_AGAIN_S)

    def _tell(self, notice: str) -> None:
        for listener in self._listeners:
            listener(notice)


async def _end(session: AsyncConnection) -> None:
    """Close a session for good: one that the pool took back would keep its locks."""
    if not session.closed:
        await session.invalidate()
        await session.close()


async def _on_end(session: AsyncConnection, ended: asyncio.Event) -> None:
    """Set `ended` when the server or the network ends the session."""
    raw: Any = (await session.get_raw_connection()).driver_connection
    raw.add_termination_listener(lambda _: ended.set())


def _upgrade(connection: Connection) -> None:
    connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_UPGRADE_LOCK})")
    if connection.exec_driver_sql("SHOW fsync").scalar() != "on":
        _LOG.warning("fsync is off on this server: what it commits may be lost")
    migrate(connection)


def _first_line(error: BaseException) -> str:
    text = str(getattr(error, "orig", None) or error).strip()
    return text.splitlines()[0] if text else type(error).__name__
