"""What is kept of snapshots and their chapters, on SQLite and on PostgreSQL."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
import sqlalchemy as sa
from lineloom_service.store import tables
from lineloom_service.store.actions import append_scans, delete_site
from lineloom_service.store.choice import database_at
from lineloom_service.store.records import ChapterLostError, NewScan, SnapshotRecord
from lineloom_service.store.snapshots import (
    drop_snapshot,
    read_chapters,
    read_snapshot,
    save_snapshot,
)
from lineloom_service.store.sql_store import SqlStore

SITE = 1


@pytest_asyncio.fixture
async def store(database_url: str | None, tmp_path: Path) -> AsyncIterator[SqlStore]:
    """A store with one site, number 1."""
    database = database_at(database_url, tmp_path / "lineloom.db")
    store = SqlStore(database, gap_window_s=9.0, max_held=100)
    await store.open()
    answer = await store.write(append_scans, "s", "r", [NewScan("0", 0, b"")], processed=0, limit=9)
    assert answer.site_id == SITE
    yield store
    await store.close()


def _chapters(*numbers: int) -> tuple[bytes, ...]:
    return tuple(b"chapter %d" % number for number in numbers)


def _snapshot(position: int, first: int, *numbers: int, producer: str = "v1") -> SnapshotRecord:
    return SnapshotRecord(position, position, producer, b"state", first, _chapters(*numbers))


async def _read(store: SqlStore, producer: str = "v1") -> tuple[bytes, ...]:
    """The chapters of the latest snapshot."""
    latest = await store.read(read_snapshot, SITE, producer)
    assert latest is not None
    assert latest.chapters == ()
    return tuple([chapter async for chapter in read_chapters(store, SITE, latest)])


async def _kept(store: SqlStore) -> list[tuple[str, int]]:
    c = tables.chapters.c
    query = sa.select(c.producer, c.number).order_by(c.producer, c.number)
    return await store.read(lambda connection: [tuple(row) for row in connection.execute(query)])


async def test_a_snapshot_goes_on_from_what_earlier_ones_have_brought(store: SqlStore) -> None:
    await store.write_as_engine(save_snapshot, SITE, _snapshot(10, 0, 0, 1))
    await store.write_as_engine(save_snapshot, SITE, _snapshot(20, 2))
    assert await _read(store) == _chapters(0, 1)
    await store.write_as_engine(save_snapshot, SITE, _snapshot(30, 2, 2))
    assert await _read(store) == _chapters(0, 1, 2)
    await store.write_as_engine(
        save_snapshot, SITE, _snapshot(40, 0, 0, 1, 2, 3)
    )  # made anew from the log
    assert await _read(store) == _chapters(0, 1, 2, 3)


async def test_two_snapshots_are_kept_and_what_they_go_on_from(store: SqlStore) -> None:
    for position, first in ((10, 0), (20, 1), (30, 2)):
        await store.write_as_engine(save_snapshot, SITE, _snapshot(position, first, first))
    await store.write_as_engine(drop_snapshot, SITE, 30)
    assert await _kept(store) == [("v1", 0), ("v1", 1)]
    assert await _read(store) == _chapters(0, 1)
    await store.write_as_engine(drop_snapshot, SITE, 20)
    assert await _kept(store) == []
    assert await store.read(read_snapshot, SITE, "v1") is None


async def test_what_another_version_saved_stays_until_this_one_is_as_far(store: SqlStore) -> None:
    await store.write_as_engine(save_snapshot, SITE, _snapshot(10, 0, 0, 1))
    await store.write_as_engine(save_snapshot, SITE, _snapshot(30, 2, 2))
    await store.write_as_engine(save_snapshot, SITE, _snapshot(5, 0, 7, producer="v2"))
    await store.write_as_engine(save_snapshot, SITE, _snapshot(20, 1, 8, producer="v2"))
    assert await _read(store) == _chapters(0, 1, 2)
    assert await _read(store, "v2") == _chapters(7, 8)
    await store.write_as_engine(save_snapshot, SITE, _snapshot(40, 2, 9, producer="v2"))
    assert await store.read(read_snapshot, SITE, "v1") is None
    assert await _kept(store) == [("v2", 0), ("v2", 1), ("v2", 2)]


async def test_sites_have_chapters_of_their_own(store: SqlStore) -> None:
    other = await store.write(append_scans, "t", "r", [NewScan("0", 0, b"")], processed=0, limit=9)
    await store.write_as_engine(save_snapshot, SITE, _snapshot(10, 0, 0, 1))
    await store.write_as_engine(save_snapshot, other.site_id, _snapshot(10, 0, 5))
    await store.write_as_engine(drop_snapshot, other.site_id, 10)
    assert await _read(store) == _chapters(0, 1)


@pytest.mark.parametrize("how", ["lost", "damaged"])
async def test_a_chapter_that_is_not_as_it_was_saved_is_told(store: SqlStore, how: str) -> None:
    await store.write_as_engine(save_snapshot, SITE, _snapshot(10, 0, 0, 1, 2))
    is_it = tables.chapters.c.number == 1
    delete, damage = sa.delete(tables.chapters), sa.update(tables.chapters).values(data=b"else")
    harm = (delete if how == "lost" else damage).where(is_it)
    await store.write_apart(lambda connection: connection.execute(harm))
    latest = await store.read(read_snapshot, SITE, "v1")
    assert latest is not None
    chapters = read_chapters(store, SITE, latest)
    assert await anext(chapters) == b"chapter 0"
    with pytest.raises(ChapterLostError, match=f"chapter 1 of its history is {how}"):
        await anext(chapters)


async def test_chapters_go_with_their_site(store: SqlStore) -> None:
    await store.write_as_engine(save_snapshot, SITE, _snapshot(10, 0, *range(50)))
    assert len(await _kept(store)) == 50
    await store.write(delete_site, "s")
    async with asyncio.timeout(60.0):
        while await _kept(store):
            await asyncio.sleep(0.01)
    await store.write_as_engine(
        save_snapshot, SITE, _snapshot(20, 0, 0)
    )  # by a worker that was late
    assert await _kept(store) == []
