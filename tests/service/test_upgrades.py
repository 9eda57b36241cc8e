"""A kill at any statement of an upgrade costs another start, and nothing else."""

from __future__ import annotations

import functools
import itertools
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
import sqlalchemy as sa
from lineloom_service.store import sqlite_upgrade
from lineloom_service.store.migrate import current_revision, migrate
from lineloom_service.store.migrations import versions
from lineloom_service.store.postgres_database import PostgresDatabase
from lineloom_service.store.records import StoreError
from lineloom_service.store.sql_store import SqlStore
from lineloom_service.store.sqlite_database import SqliteDatabase

from tests.service.databases import POSTGRESQL, fresh_database
from tests.service.old_databases import REVISIONS, Rows, make_old, make_old_file, read_all

OLDER = REVISIONS[:-1]
HALVED = REVISIONS[: REVISIONS.index("0008")]
"""Those that earlier versions upgraded further, and could leave halfway."""

Contents = dict[str, tuple[list[str], list[tuple[object, ...]]]]
"""Table -> its columns and its rows."""

Schema = list[tuple[str]]

_columns_from = functools.cache(sqlite_upgrade._columns_from)


def _from(revisions: tuple[str, ...]) -> pytest.MarkDecorator:
    """Try each, and none. The oldest takes the steps of those between, whose tests are long."""
    between = (pytest.param(revision, marks=pytest.mark.long) for revision in revisions[1:-1])
    return pytest.mark.parametrize("revision", [None, revisions[0], *between, revisions[-1]])


class Killed(BaseException):
    """Stands for the end of the process: nobody catches it."""


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a revision consists of is asked hundreds of times, and is the same each time."""
    monkeypatch.setattr(sqlite_upgrade, "_columns_from", _columns_from)


def _contents(path: Path) -> Contents:
    with closing(sqlite3.connect(path)) as connection:
        found = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        contents = {}
        for table in sorted(name for (name,) in found):
            if table not in {"alembic_version", "sqlite_sequence"}:
                rows = connection.execute(f"SELECT * FROM {table}")
                contents[table] = ([about[0] for about in rows.description], rows.fetchall())
        return contents


def _schema(path: Path) -> Schema:
    with closing(sqlite3.connect(path)) as connection:
        return connection.execute("SELECT sql FROM sqlite_master ORDER BY name").fetchall()


def _copies(path: Path) -> list[str]:
    return sorted(copy.name for copy in path.parent.glob(f"{path.name}.*"))


def _undisturbed(directory: Path, revision: str | None) -> Schema:
    """Return what an upgrade that nothing disturbs makes of a file."""
    path = directory / "undisturbed.db"
    if revision is not None:
        make_old_file(path, revision)
    sqlite_upgrade.upgrade_file(path)
    return _schema(path)


async def _starts(path: Path, before: Contents, schema: Schema) -> None:
    """The service opens the file, with all rows, and with the tables of an undisturbed upgrade."""
    store = SqlStore(SqliteDatabase(path), gap_window_s=60.0, max_held=1000)
    await store.open()
    assert [site.accepted for site in await store.sites()] == ([4] if before else [])
    await store.close()
    assert _schema(path) == schema
    with closing(sqlite3.connect(path)) as connection:
        for table, (columns, rows) in before.items():
            found = connection.execute(f"SELECT {', '.join(columns)} FROM {table}")
            assert found.fetchall() == rows, table
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        assert connection.execute("PRAGMA foreign_key_check").fetchall() == []


@_from(OLDER)
async def test_a_kill_at_any_step_costs_another_start_and_one_copy(
    tmp_path: Path, revision: str | None
) -> None:
    source, homes = tmp_path / "old.db", tmp_path / "killed"
    homes.mkdir()
    before: Contents = {}
    if revision is not None:
        make_old_file(source, revision)
        before = _contents(source)
    copies = [] if revision is None else [f"lineloom.db.backup-{revision}"]
    schema = _undisturbed(tmp_path, revision)
    subprocess.run(
        [sys.executable, "-m", "tests.service.killed_upgrades", str(source), str(homes)],
        check=True,
        cwd=Path(__file__).parents[2],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        stderr=subprocess.DEVNULL,
    )
    killed = sorted(homes.iterdir())
    assert len(killed) > 2 * (len(REVISIONS) - REVISIONS.index(revision or "0001"))
    started: list[list[object]] = []
    for home in killed:
        path = home / "lineloom.db"
        state: list[object] = [
            _schema(path),
            _contents(path),
            {f.name: f.stat().st_size for f in home.iterdir()},
        ]
        assert state[0] == schema or state[1] == before
        if state in started:  # what a start finds is the same, so what it does is
            continue
        started.append(state)
        await _starts(path, before, schema)
        assert _copies(path) == copies
        for copy in copies:
            assert _contents(path.with_name(copy)) == before
    assert len(started) > len(copies) + 1


@contextmanager
def _dies_before(is_it: Callable[[str], bool]) -> Iterator[None]:
    """Have a statement to the database raise Killed instead of being sent."""

    def watch(connection: sa.Connection, _cursor: object, statement: str, *_: object) -> None:
        in_memory = connection.engine.url.database is None
        if not in_memory and is_it(statement):
            raise Killed

    sa.event.listen(sa.Engine, "before_cursor_execute", watch)
    try:
        yield
    finally:
        sa.event.remove(sa.Engine, "before_cursor_execute", watch)


def _nth_change(number: int) -> Callable[[str], bool]:
    count = itertools.count(1)
    return lambda statement: "SELECT" not in statement and next(count) == number


def _upgrade_as_before(path: Path) -> None:
    """Upgrade as earlier versions did: with the driver's own notion of a transaction."""
    engine = sa.create_engine(f"sqlite:///{path}")
    try:
        with engine.begin() as connection:
            migrate(connection)
    finally:
        engine.dispose()


def _half_upgraded(directory: Path, revision: str | None) -> Iterator[Path]:
    """Yield each different state that earlier versions left, killed at one statement or another."""
    source = directory / "old.db"
    if revision is not None:
        make_old_file(source, revision)
    schemas: list[Schema] = []
    for number in itertools.count(1):
        path = directory / str(number) / "lineloom.db"
        path.parent.mkdir()
        if revision is not None:
            shutil.copy(source, path)
        try:
            with _dies_before(_nth_change(number)):
                _upgrade_as_before(path)
        except Killed:
            if (schema := _schema(path)) not in schemas:
                schemas.append(schema)
                yield path
        else:
            return


@_from(HALVED)
async def test_what_an_earlier_version_left_half_upgraded_is_completed(
    tmp_path: Path, revision: str | None
) -> None:
    whole = _undisturbed(tmp_path, revision)
    states = 0
    for path in _half_upgraded(tmp_path, revision):
        states += 1
        rows = {table: there for table, there in _contents(path).items() if there[1]}
        copies = [] if revision is None else [f"lineloom.db.backup-{revision}"]
        if copies:
            # What is in the file is the truth, whatever copies there are: this one is of long ago.
            path.with_name(copies[0]).write_text("of long ago")
            copies.append(f"{copies[0]}.2")
        await _starts(path, rows, whole)
        assert _copies(path) == copies
    # As it was, and at least once with something of the next revision.
    assert states > 1


def test_there_is_an_old_database_of_every_revision() -> None:
    steps = Path(versions.__file__).parent.glob("r*.py")
    assert sorted(step.name[1:5] for step in steps) == list(REVISIONS)


async def test_the_copy_of_a_start_that_failed_serves_the_next(tmp_path: Path) -> None:
    path = tmp_path / "lineloom.db"
    make_old_file(path, "0007")
    before = _contents(path)
    for _ in range(3):
        with pytest.raises(Killed), _dies_before(lambda statement: "ALTER TABLE" in statement):
            sqlite_upgrade.upgrade_file(path)
        assert _contents(path) == before
        assert _copies(path) == ["lineloom.db.backup-0007"]
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("UPDATE snapshots SET data = 'other'")
        connection.commit()
    sqlite_upgrade.upgrade_file(path)
    assert _copies(path) == ["lineloom.db.backup-0007", "lineloom.db.backup-0007.2"]
    assert _contents(tmp_path / "lineloom.db.backup-0007") == before


async def test_rows_in_the_way_of_an_upgrade_are_not_thrown_away(tmp_path: Path) -> None:
    path = tmp_path / "lineloom.db"
    make_old_file(path, "0007")
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("CREATE TABLE chapters (site_id INTEGER, note TEXT)")
        connection.execute("INSERT INTO chapters VALUES (1, 'by hand')")
        connection.commit()
    before = _contents(path)
    with pytest.raises(StoreError, match="rows in a table 'chapters'"):
        await SqliteDatabase(path).open()
    assert _contents(path) == before


async def test_a_table_of_somebody_elses_stays(tmp_path: Path) -> None:
    path = tmp_path / "lineloom.db"
    make_old_file(path, "0007")
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("CREATE TABLE notes (text TEXT)")
        connection.execute("INSERT INTO notes VALUES ('mine')")
        connection.commit()
    sqlite_upgrade.upgrade_file(path)
    assert _contents(path)["notes"] == (["text"], [("mine",)])


async def _postgres(url: str, revision: str | None) -> None:
    """Make a database of this revision on the server."""
    if revision is None:
        return
    database = PostgresDatabase(url)
    await database.write(lambda connection: make_old(connection, revision))
    await database.close()


async def _state(url: str) -> tuple[str | None, Rows]:
    database = PostgresDatabase(url)
    try:
        return await database.read(lambda c: (current_revision(c), read_all(c)))
    finally:
        await database.close()


async def _tables(url: str) -> list[str]:
    database = PostgresDatabase(url)
    try:
        return await database.read(lambda c: sorted(sa.inspect(c).get_table_names()))
    finally:
        await database.close()


@pytest.mark.parametrize("revision", [None, "0001", "0007"])
async def test_postgresql_is_upgraded_as_a_whole_or_not_at_all(revision: str | None) -> None:
    async with fresh_database(POSTGRESQL) as url:
        assert url is not None
        await _postgres(url, revision)
        before, there = await _state(url), await _tables(url)
        for number in itertools.count(1):
            database = PostgresDatabase(url)
            try:
                with _dies_before(_nth_change(number)):
                    await database.open()
                break
            except Killed:
                assert await _tables(url) == there
            finally:
                await database.close()
        # Revision 0009 changes no table: it takes but one statement.
        assert number >= 2 * (len(REVISIONS) - REVISIONS.index(revision or "0001"))
        now = await _state(url)
        assert now[0] == REVISIONS[-1]
        for table, rows in before[1].items():
            found = zip(now[1][table], rows, strict=True)
            assert [{name: row[name] for name in old} for row, old in found] == rows


_KILLED_AT = """
import asyncio, os, signal, sys
from lineloom_service.store.postgres_database import PostgresDatabase
from sqlalchemy import Engine, event

def watch(_connection, _cursor, statement, *_):
    if sys.argv[2] in statement:
        os.kill(os.getpid(), signal.SIGKILL)

event.listen(Engine, "before_cursor_execute", watch)
asyncio.run(PostgresDatabase(sys.argv[1]).open())
"""


@pytest.mark.parametrize("statement", ["CREATE TABLE chapters", "UPDATE alembic_version"])
async def test_a_killed_upgrade_of_postgresql_costs_another_start(statement: str) -> None:
    async with fresh_database(POSTGRESQL) as url:
        assert url is not None
        await _postgres(url, "0007")
        before = await _state(url)
        killed = subprocess.run([sys.executable, "-c", _KILLED_AT, url, statement], check=False)
        assert killed.returncode == -signal.SIGKILL
        assert await _state(url) == before
        database = PostgresDatabase(url)
        await database.open()
        await database.close()
        assert (await _state(url))[0] == REVISIONS[-1]
