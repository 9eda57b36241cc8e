"""Workers that hang, or cannot be started: found, told of and replaced, whatever they were at."""

from __future__ import annotations

import asyncio
import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from lineloom_service.engine import local_engine, worker_process
from lineloom_service.engine.signs_of_life import SILENT_LOOKS, SignsOfLife

from tests.service.system import System, fingerprint, running

QUICK_LOOK_S = 0.15
"""A worker's heart beats every half second."""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[int, tuple[str, ...]]:
    """The view after scans 0..99 in a run that nothing happened to."""

    async def run() -> tuple[int, tuple[str, ...]]:
        async with running(tmp_path_factory.mktemp("undisturbed"), None) as system:
            await system.post(range(100))
            return fingerprint((await system.caught_up()).view)

    return asyncio.run(run())


async def _until(done: Callable[[], object]) -> None:
    async with asyncio.timeout(30.0):
        while not done():
            await asyncio.sleep(0.005)


def _told(system: System, words: str) -> bool:
    """Whether the site's trouble and the readiness say this."""
    reasons = "; ".join(system.conductor.not_ready())
    return words in (system.conductor.trouble(1) or "") and words in reasons


def _well(system: System) -> bool:
    return system.conductor.trouble(1) is None and not system.conductor.not_ready()


def _handles() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


class Shortage:
    """What starts workers, and refuses to while something is short."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.of: Exception | None = None
        self.refused = 0
        self._start = vars(worker_process)["subprocess"].Popen  # forked ones: see `zygote`
        found = SimpleNamespace(Popen=self._popen, DEVNULL=subprocess.DEVNULL)
        monkeypatch.setattr(worker_process, "subprocess", found)

    def _popen(self, *arguments: Any, **options: Any) -> Any:
        if self.of is not None:
            self.refused += 1
            raise self.of
        return self._start(*arguments, **options)


@pytest.mark.parametrize(
    "shortage",
    [OSError(errno.EMFILE, "Too many open files"), MemoryError()],
)
async def test_a_worker_that_cannot_be_started_is_tried_again_until_it_can(
    tmp_path: Path,
    undisturbed: tuple[int, tuple[str, ...]],
    monkeypatch: pytest.MonkeyPatch,
    shortage: Exception,
) -> None:
    workers = Shortage(monkeypatch)
    async with running(tmp_path, None) as system:
        await system.post(range(60))
        await system.caught_up()
        open_before = _handles()
        workers.of = shortage
        os.kill(system.engine.pids[0], signal.SIGKILL)
        await _until(lambda: workers.refused >= 3)
        assert _told(system, "cannot be started")
        assert _handles() <= open_before  # each try leaves nothing behind
        await system.post(range(60, 100))  # taken all the while
        workers.of = None
        assert fingerprint((await system.caught_up()).view) == undisturbed
        await _until(lambda: _well(system))


async def test_the_first_worker_is_tried_again_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workers = Shortage(monkeypatch)
    workers.of = OSError(errno.EAGAIN, "Resource temporarily unavailable")
    async with running(tmp_path, None) as system:
        await system.post(range(10))
        await _until(lambda: workers.refused >= 3 and _told(system, "temporarily unavailable"))
        workers.of = None
        await system.caught_up()


@pytest.mark.parametrize("busy", [True, False])
async def test_a_stopped_worker_is_told_of_and_replaced(
    tmp_path: Path,
    undisturbed: tuple[int, tuple[str, ...]],
    monkeypatch: pytest.MonkeyPatch,
    busy: bool,
) -> None:
    monkeypatch.setattr(local_engine, "LOOK_S", QUICK_LOOK_S)
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", "0.02" if busy else "0")
    async with running(tmp_path, None) as system:
        await system.post(range(60))
        await system.until(lambda p: p.position >= (5 if busy else 60))
        stopped = system.engine.pids[0]
        os.kill(stopped, signal.SIGSTOP)
        await _until(lambda: _told(system, "gives no sign of life"))
        await _until(lambda: system.engine.pids not in ([], [stopped]))
        await system.post(range(60, 100))
        published = await system.caught_up()
        assert fingerprint(published.view) == undisturbed
        assert published.skipped == 0
        await _until(lambda: _well(system))


async def test_an_entry_is_not_blamed_for_workers_that_are_stopped_at_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(local_engine, "LOOK_S", QUICK_LOOK_S)
    monkeypatch.setenv("FAKE_MAPPER_SECONDS", "0.3")
    async with running(tmp_path, None) as system:
        await system.post(range(4))
        stopped: set[int] = set()
        for _ in range(4):  # a crash is forgiven twice
            await _until(lambda: set(system.engine.pids) - stopped and _at_work(system))
            os.kill(system.engine.pids[0], signal.SIGSTOP)
            stopped.add(system.engine.pids[0])
        assert (await system.caught_up()).skipped == 0


def _at_work(system: System) -> bool:
    process = system.engine._slots[0].process
    return process is not None and process.ready and process._current.read() is not None


def test_a_child_that_computes_without_a_heartbeat_is_alive_and_a_stopped_one_is_not() -> None:
    program = [sys.executable, "-c", "while True: sum(range(10**6))"]
    with subprocess.Popen(program) as child:
        signs = SignsOfLife(child.pid, lambda: 0)
        for _ in range(SILENT_LOOKS + 2):
            signs.look()
            time.sleep(0.1)
        assert not signs.gone
        child.send_signal(signal.SIGSTOP)
        looks = 0
        while not signs.gone and looks < 50:
            time.sleep(0.02)
            signs.look()
            looks += 1
        assert SILENT_LOOKS <= looks < 50
        assert signs.stopped
        child.kill()


async def test_what_nobody_foresaw_does_not_end_a_site(
    tmp_path: Path, undisturbed: tuple[int, tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running(tmp_path, None) as system:
        await system.post(range(60))
        await system.caught_up()
        read = system.store.read

        async def no_threads(*_: object) -> None:
            raise RuntimeError("can't start new thread")

        monkeypatch.setattr(system.store, "read", no_threads)
        await system.post(range(60, 100))
        await _until(lambda: "can't start new thread" in (system.conductor.trouble(1) or ""))
        monkeypatch.setattr(system.store, "read", read)
        assert fingerprint((await system.caught_up()).view) == undisturbed
        await _until(lambda: _well(system))
