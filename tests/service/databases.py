"""Databases of each kind for the tests: a file, or a database of its own on a PostgreSQL server."""

from __future__ import annotations

import os
import uuid
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from sqlalchemy import make_url, text
from sqlalchemy.ext.asyncio import create_async_engine

SQLITE, POSTGRESQL = "sqlite", "postgresql"
KINDS = (SQLITE, POSTGRESQL)

_STARTED = Path(f"/tmp/lineloom-postgres-{os.getuid()}/url")


def server_url() -> str:
    """Return where the tests' PostgreSQL is; skips the test where there is none."""
    given = os.environ.get("LINELOOM_TEST_POSTGRES")
    if given:
        return given
    if not _STARTED.is_file():
        pytest.skip("no PostgreSQL server: `.ci/postgres start` starts one")
    return _STARTED.read_text().strip()


@asynccontextmanager
async def fresh_database(kind: str) -> AsyncIterator[str | None]:
    """Make an empty database, to be removed in the end; its URL, None for the SQLite file."""
    if kind == SQLITE:
        yield None
        return
    server = make_url(server_url())
    name = f"lineloom_test_{uuid.uuid4().hex[:12]}"
    engine = create_async_engine(server, isolation_level="AUTOCOMMIT")
    async with engine.connect() as connection:
        await connection.execute(text(f"CREATE DATABASE {name}"))
    try:
        yield server.set(database=name).render_as_string(hide_password=False)
    finally:
        async with engine.connect() as connection:
            await connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))
        await engine.dispose()
