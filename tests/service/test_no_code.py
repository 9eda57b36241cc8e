"""Whoever can write to the database, or is a worker, runs no code: it is said, and gone on."""

from __future__ import annotations

import asyncio
import pickle
import sqlite3
import zlib
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from lineloom_core.codec import CodecError, decode, encode
from lineloom_core.mapping.facts.chapter import Chapter
from lineloom_service.engine.conductor import Conductor
from lineloom_service.engine.forwarding import Forwarding
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.engine.protocol import QuestionFailedError
from lineloom_service.engine.published import Published
from lineloom_service.engine.questions import pack_question, unpack_question
from lineloom_service.store.actions import append_scans
from lineloom_service.store.questions import post_answer, post_question, read_question, take_answer

from tests.service.bombs import bomb
from tests.service.system import System, fingerprint, new_scan, running, started

SCANS = 60


@pytest.fixture
def fuse(tmp_path: Path) -> Path:
    return tmp_path / "fuse"


def test_the_bomb_is_none_of_the_duds(fuse: Path) -> None:
    pickle.loads(bomb(fuse))
    assert fuse.exists()


def _with_mapper(path: Path, mapper: str) -> System:
    system = System(path, None)
    system.engine = LocalEngine(1, publish_every_s=0.05, mapper=mapper, warm_up=None)
    system.conductor = Conductor(system.store, system.engine, system.settings)
    return system


async def _mapped(system: System) -> Published:
    """What there is when all is mapped; the real mapper takes its time to start."""
    record = await system.store.site("site")
    assert record is not None
    assert await system.conductor.reached(record.id, record.position, 120.0)
    return await system.published()


@pytest.mark.parametrize("where", ["snapshot", "raw snapshot", "chapter"])
async def test_a_bomb_in_what_was_saved_does_not_go_off(
    tmp_path: Path, fuse: Path, where: str, caplog: pytest.LogCaptureFixture
) -> None:
    async with started(_with_mapper(tmp_path, "bombs:SHORT_CHAPTERS")) as system:
        await system.post(range(SCANS))
        before = fingerprint((await _mapped(system)).view)
        database = system.settings.database_path
    with closing(sqlite3.connect(database)) as connection:
        assert connection.execute("SELECT min(chapters) FROM snapshots").fetchone()[0] > 1
        data = bomb(fuse) if where == "raw snapshot" else zlib.compress(bomb(fuse))
        if where == "chapter":
            changed = connection.execute(
                "UPDATE chapters SET data = ?, crc = ?", (data, zlib.crc32(data))
            )
        else:
            changed = connection.execute("UPDATE snapshots SET data = ?", (data,))
        assert changed.rowcount > 0
        connection.commit()
    caplog.clear()
    async with started(_with_mapper(tmp_path, "bombs:SHORT_CHAPTERS")) as system:
        found = await _mapped(system)
        assert fingerprint(found.view) == before
        assert (found.scans, found.skipped) == (SCANS, 0)
    assert not fuse.exists()
    assert "is unreadable" in caplog.text


def test_a_bomb_in_a_chapter_does_not_go_off_when_it_is_opened(fuse: Path) -> None:
    """Whoever forges the check as well is told when somebody undoes something."""
    for data in (bomb(fuse), zlib.compress(bomb(fuse)), zlib.compress(encode((bomb(fuse),)))):
        with pytest.raises(CodecError):
            Chapter.unpack(data)
    assert not fuse.exists()


async def test_a_bomb_for_a_question_is_answered_with_what_is_wrong(
    tmp_path: Path, fuse: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with running(tmp_path, None) as system:
        forwarding = Forwarding(system.store, system.engine.ask)
        asked = {
            "bomb": bomb(fuse),
            "inside": encode((1, "what_if", bomb(fuse))),
            "method": pack_question(1, "forget", ("r",)),
            "argument": pack_question(1, "what_if", (7,)),
        }
        for key, question in asked.items():
            await system.store.write_apart(post_question, key, question)
            forwarding.on_question(key)
            async with asyncio.timeout(60.0):
                while (answer := await system.store.write_apart(take_answer, key)) is None:
                    await asyncio.sleep(0.01)
            outcome, reason = decode(answer, tuple[str, bytes])
            assert outcome == "failed"
            assert reason.startswith(b"unreadable question: ")
    assert not fuse.exists()
    assert caplog.text.count("a forwarded question is unreadable") == len(asked)


async def test_a_bomb_for_an_answer_is_no_answer(
    tmp_path: Path, fuse: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with running(tmp_path, None) as system:
        forwarding = Forwarding(system.store, system.engine.ask)
        answers = [bomb(fuse), encode(("answered", bomb(fuse))), encode(("answered", encode(7)))]
        for forged in (*answers, encode(("else", b""))):
            asking = asyncio.create_task(forwarding.ask(1, "what_if", "p1-2"))
            async with asyncio.timeout(60.0):
                while not (keys := list(forwarding._waiting)):
                    await asyncio.sleep(0.01)
                (key,) = keys
                while await system.store.read(read_question, key) is None:
                    await asyncio.sleep(0.01)
            await system.store.write_apart(post_answer, key, forged)
            forwarding.on_answer(key)
            with pytest.raises(QuestionFailedError, match="unreadable answer"):
                await asking
    assert not fuse.exists()
    assert "the answer to a forwarded question is unreadable" in caplog.text


async def test_a_worker_that_sends_a_bomb_is_ended_and_the_map_is_made(
    tmp_path: Path, fuse: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with started(_with_mapper(tmp_path, "bombs:Rogue")) as system:
        scans = [replace(new_scan(seq), session=str(fuse)) for seq in range(8)]
        await system.store.write(append_scans, "site", "r", scans, processed=0, limit=10**9)
        found = await _mapped(system)
        assert (found.scans, found.skipped) == (8, 0)
    assert fuse.with_suffix(".sent").exists()
    assert not fuse.exists()
    assert "the worker sent what is no report" in caplog.text


def test_questions_come_back_as_they_were_asked() -> None:
    assert unpack_question(pack_question(3, "explain", ("p1-2",))) == (3, "explain", ("p1-2",))
