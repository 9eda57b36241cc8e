"""History is saved in chapters, each once, and a mapper goes on from them bit for bit."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from lineloom_core.mapping.snapshot import Snapshot
from lineloom_service.engine import site_runner
from lineloom_service.engine.current_entry import RESTORING
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.engine.mapper import apply
from lineloom_service.engine.protocol import ResumeFailedError, WorkerDiedError
from lineloom_service.store import tables
from lineloom_service.store.records import LogEntry, SnapshotRecord, StoreError
from lineloom_service.store.snapshots import (
    drop_snapshot,
    read_chapters,
    read_snapshot,
    save_snapshot,
)
from lineloom_service.store.sql_store import SqlStore
from lineloom_service.store.transaction import Transaction

from tests.service.fake_mapper import SEALED, FakeMapper
from tests.service.system import FAKE, PRODUCER, System, fingerprint, new_scan, running, started

SITE, SCANS = 1, 200


def _undisturbed(count: int = SCANS) -> FakeMapper:
    mapper = FakeMapper()
    for seq in range(count):
        scan = new_scan(seq)
        apply(mapper, LogEntry(seq + 1, "scan", "r", scan.session, scan.seq, scan.body))
    return mapper


async def _chapters(store: SqlStore) -> tuple[bytes, ...]:
    snapshot = await store.read(read_snapshot, SITE, PRODUCER)
    if snapshot is None:
        return ()
    return tuple([chapter async for chapter in read_chapters(store, SITE, snapshot)])


def _watched(system: System, monkeypatch: pytest.MonkeyPatch) -> list[SnapshotRecord]:
    """What the system knows to be saved from now on."""
    saved: list[SnapshotRecord] = []
    write = system.store.write_as_engine

    async def watch(action: Callable[..., Any], *arguments: Any) -> Any:
        done = await write(action, *arguments)
        if action is save_snapshot:
            saved.append(arguments[1])
        return done

    monkeypatch.setattr(system.store, "write_as_engine", watch)
    return saved


async def test_every_chapter_is_saved_once(
    tmp_path: Path, database_url: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved: list[SnapshotRecord] = []
    for start, end in ((0, 120), (120, SCANS)):  # the second time it goes on from what is there
        async with running(tmp_path, database_url) as system:
            now = _watched(system, monkeypatch)
            await system.post(range(start, end))
            await system.caught_up()
        saved += now
    assert [record.position for record in saved][-1] == SCANS
    assert len(saved) > 3
    assert [record.first for record in saved] == [0, *(record.end for record in saved[:-1])]
    sealed = _undisturbed().snapshot().chapters
    assert len(sealed) == SCANS // SEALED
    assert tuple(chapter for record in saved for chapter in record.chapters) == sealed


async def test_a_worker_killed_between_snapshots_leaves_the_same_chapters_and_map(
    tmp_path: Path, database_url: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", "0.004")
    undisturbed = _undisturbed()
    async with running(tmp_path, database_url, snapshot_idle_s=0.1) as system:
        await system.post(range(SCANS))
        for position in (70, 130):
            await system.until(lambda p, at=position: p.position >= at)  # type: ignore[misc]
            os.kill(system.engine.pids[0], signal.SIGKILL)
        published = await system.caught_up()
        assert fingerprint(published.view) == fingerprint(undisturbed.view())
        async with asyncio.timeout(60.0):
            while len(await _chapters(system.store)) < SCANS // SEALED:
                await asyncio.sleep(0.02)
        assert await _chapters(system.store) == undisturbed.snapshot().chapters


@pytest.mark.parametrize(
    ("harm", "number", "dropped"),
    [
        # The snapshots at 150 and 200 go on from 9 and 12 chapters.
        pytest.param("lost", 0, (200, 150), id="lost-of-both"),
        pytest.param("damaged", 3, (200, 150), id="damaged-of-both"),
        pytest.param("lost", 11, (200,), id="lost-of-the-latest"),
    ],
)
async def test_without_a_chapter_the_map_is_made_from_what_there_is(
    tmp_path: Path,
    database_url: str | None,
    caplog: pytest.LogCaptureFixture,
    harm: str,
    number: int,
    dropped: tuple[int, ...],
) -> None:
    async with running(tmp_path, database_url) as system:
        await _map_and_save(system)
        c = tables.chapters.c
        delete, damage = sa.delete(tables.chapters), sa.update(tables.chapters).values(data=b"?")
        how = (delete if harm == "lost" else damage).where(c.number == number)
        await system.store.write_apart(lambda connection: connection.execute(how))
    undisturbed = _undisturbed(SCANS + 20)
    caplog.set_level(logging.ERROR)
    async with running(tmp_path, database_url) as system:
        await system.post(range(SCANS, SCANS + 20))
        published = await system.caught_up()
        assert fingerprint(published.view) == fingerprint(undisturbed.view())
        assert system.conductor.trouble(SITE) is None
    said = f"is unreadable: chapter {number} of its history is {harm}"
    assert [m for m in caplog.messages if "unreadable" in m] == [
        f"site site: snapshot {position} {said}" for position in dropped
    ]
    async with running(tmp_path, database_url) as system:  # it has all chapters again
        await system.caught_up()
        assert await _chapters(system.store) == undisturbed.snapshot().chapters


async def test_a_snapshot_that_cannot_be_removed_does_not_end_the_mapping(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(site_runner, "_AGAIN_S", 0.05)
    async with running(tmp_path, None) as system:
        await _map_and_save(system)
        await system.store.write_apart(lambda c: c.execute(sa.delete(tables.chapters)))
    system = System(tmp_path, None)
    refused = [200, 150]

    def refuse(tx: Transaction, site_id: int, position: int) -> None:
        if position in refused:
            refused.remove(position)
            raise StoreError("the storage failed")
        drop_snapshot(tx, site_id, position)

    monkeypatch.setattr(site_runner, "drop_snapshot", refuse)
    async with started(system):
        published = await system.until(lambda p: p.position >= SCANS)
        assert fingerprint(published.view) == fingerprint(_undisturbed().view())
    assert refused == []


async def _map_and_save(system: System) -> None:
    """Map all scans, with a snapshot after every fiftieth."""
    for start in range(0, SCANS, 50):
        await system.post(range(start, start + 50))
        await system.caught_up()
    await _saved(system, SCANS)


async def _saved(system: System, position: int) -> None:
    async with asyncio.timeout(60.0):
        while True:
            snapshot = await system.store.read(read_snapshot, SITE, PRODUCER)
            if snapshot is not None and snapshot.position == position:
                return
            await asyncio.sleep(0.02)


@asynccontextmanager
async def _engine() -> AsyncIterator[LocalEngine]:
    engine = LocalEngine(1, mapper=FAKE, warm_up=None)
    await engine.start()
    try:
        yield engine
    finally:
        await engine.stop()


class _Reading:
    """Chapters as they are read. At number `at` something happens first."""

    def __init__(self, chapters: tuple[bytes, ...]) -> None:
        self.count = 0
        self.at, self.reached, self.go_on = -1, asyncio.Event(), asyncio.Event()
        self._chapters = chapters

    async def read(self) -> AsyncIterator[bytes]:
        for number, chapter in enumerate(self._chapters):
            if number == self.at:
                self.reached.set()
                await self.go_on.wait()
            self.count += 1
            yield chapter


async def _snapshot(engine: LocalEngine) -> Snapshot:
    """One of five chapters, as the engine gives it."""
    await engine.start_site(SITE, 0, None)
    scans = [new_scan(seq) for seq in range(5 * SEALED)]
    entries = [LogEntry(at, "scan", "r", s.session, s.seq, s.body) for at, s in enumerate(scans, 1)]
    await engine.feed(SITE, entries, len(entries), caught_up=True)
    return await engine.snapshot(SITE)


async def test_a_chapter_is_read_when_the_one_before_has_arrived() -> None:
    async with _engine() as engine:
        snapshot = await _snapshot(engine)
        assert len(snapshot.chapters) == 5
        reading = _Reading(snapshot.chapters)
        os.kill(engine.pids[0], signal.SIGSTOP)
        start = asyncio.create_task(engine.start_site(SITE, 80, snapshot.state, reading.read()))
        await asyncio.sleep(0.3)
        assert reading.count == 1
        os.kill(engine.pids[0], signal.SIGCONT)
        await start
        assert reading.count == 5
        assert await engine.snapshot(SITE) == snapshot
        assert (await engine.snapshot(SITE, 3)).chapters == snapshot.chapters[3:]


async def test_a_worker_that_dies_between_chapters_does_not_go_on_from_half_of_them() -> None:
    async with _engine() as engine:
        snapshot = await _snapshot(engine)
        reading = _Reading(snapshot.chapters)
        reading.at = 2
        start = asyncio.create_task(engine.start_site(SITE, 80, snapshot.state, reading.read()))
        await reading.reached.wait()
        with pytest.raises(WorkerDiedError, match="being resumed"):
            await engine.ask(SITE, "rays", "c1")
        (killed,) = engine.pids
        os.kill(killed, signal.SIGKILL)
        async with asyncio.timeout(60.0):
            while engine.pids in ([], [killed]) or engine.not_ready():
                await asyncio.sleep(0.01)
        reading.go_on.set()
        with pytest.raises(WorkerDiedError, match="SIGKILL"):
            await start
        await engine.start_site(SITE, 80, snapshot.state, _Reading(snapshot.chapters).read())
        assert await engine.snapshot(SITE) == snapshot


async def test_a_worker_that_dies_of_a_chapter_dies_of_restoring() -> None:
    async with _engine() as engine:
        snapshot = await _snapshot(engine)
        os.kill(engine.pids[0], signal.SIGSTOP)
        start = asyncio.create_task(
            engine.start_site(SITE, 80, snapshot.state, _Reading(snapshot.chapters).read())
        )
        await asyncio.sleep(0.1)
        os.kill(engine.pids[0], signal.SIGKILL)
        with pytest.raises(WorkerDiedError) as died:
            await start
        assert died.value.position == RESTORING


async def test_a_start_that_was_given_up_leaves_no_chapters_to_the_next() -> None:
    async with _engine() as engine:
        snapshot = await _snapshot(engine)
        reading = _Reading(snapshot.chapters)
        reading.at = 3
        start = asyncio.create_task(engine.start_site(SITE, 80, snapshot.state, reading.read()))
        await reading.reached.wait()
        start.cancel()
        short = _Reading(snapshot.chapters[:4])
        with pytest.raises(ResumeFailedError, match="not its chapters: 0 to 4"):
            await engine.start_site(SITE, 80, snapshot.state, short.read())
        await engine.start_site(SITE, 80, snapshot.state, _Reading(snapshot.chapters).read())
        assert await engine.snapshot(SITE) == snapshot
