"""The first start of all: who has compiled kernels does not keep the compiler."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import httpx
import pytest
from lineloom_core.warm_up.compiling import Progress
from lineloom_core.warm_up.drive import warm_up
from lineloom_service.app import create_app
from lineloom_service.engine import compilation, local_engine
from lineloom_service.engine.local_engine import LocalEngine
from lineloom_service.service import Service
from lineloom_service.settings import Settings

COMPILER = """
import os
from pathlib import Path
from typing import Literal

def warm_up():
    began = Path(os.environ["BEGAN"])
    with began.open("a") as file:
        file.write(f"{os.getpid()}\\n")
    return len(began.read_text().splitlines()) <= int(os.environ["COMPILES"])
"""


@pytest.mark.parametrize(("compiles", "begins"), [(0, 1), (1, 2), (9, 2)])
async def test_a_worker_that_has_compiled_begins_again_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiles: int, begins: int
) -> None:
    began = tmp_path / "began"
    (tmp_path / "a_compiler.py").write_text(COMPILER)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("BEGAN", str(began))
    monkeypatch.setenv("COMPILES", str(compiles))
    engine = LocalEngine(1, mapper="fake_mapper:FakeMapper", warm_up="a_compiler:warm_up")
    await engine.start()
    try:
        async with asyncio.timeout(60.0):
            await engine.start_site(7, 0, None)  # it answers, so its pipe is what it was
        assert began.read_text().split() == [str(pid) for pid in engine.pids] * begins
    finally:
        await engine.stop()


def test_what_is_in_the_cache_is_not_compiled() -> None:
    warm_up()
    assert warm_up() is False


@pytest.mark.parametrize("mode", ["require", "off"])
async def test_the_matcher_waits_for_workers_that_compile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: Literal["require", "off"]
) -> None:
    compiling = ["worker 0 is warming up"]
    engine = LocalEngine(1, mapper="fake_mapper:FakeMapper", warm_up=None)
    monkeypatch.setattr(engine, "not_ready", lambda: list(compiling))
    service = Service(Settings(data_dir=tmp_path, engine=mode), engine=engine)
    asked, warm = asyncio.Event(), service.matcher.warm_up

    async def warm_up_matcher() -> None:
        asked.set()
        await warm()

    monkeypatch.setattr(service.matcher, "warm_up", warm_up_matcher)
    await service.start()
    try:
        if mode == "require":
            for _ in range(100):
                await asyncio.sleep(0)
            assert not asked.is_set()
            compiling.clear()
        async with asyncio.timeout(60.0):
            await asked.wait()
    finally:
        await service.stop()


SCAN = {
    **{"seq": 0, "stamp": 0.0, "angle_min": -1.0, "angle_increment": 0.5},
    **{"range_min": 0.1, "range_max": 30.0, "ranges": [1.0, 2.0, 3.0, 4.0, 5.0]},
}


class _FakeCompiler:
    """Compiles nothing, and says what the test says."""

    of = 3

    def __init__(self, report: Callable[[Progress], object]) -> None:
        self.report = report
        self.stopped = False
        self.ends = threading.Event()
        self.failure: Exception | None = None

    def run(self) -> None:
        self.ends.wait(60.0)
        if self.failure is not None:
            raise self.failure

    def stop(self) -> None:
        self.stopped = True
        self.ends.set()


@pytest.fixture
def compiler(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[_FakeCompiler]]:
    """The compilers that engines make; a first start on a machine. Workers have a fake mapper."""
    made: list[_FakeCompiler] = []

    def make(report: Callable[[Progress], object]) -> _FakeCompiler:
        made.append(_FakeCompiler(report))
        return made[-1]

    monkeypatch.setattr(compilation, "Compiler", make)
    monkeypatch.setattr(compilation, "is_compiled", lambda: False)
    monkeypatch.setattr(local_engine, "WARM_UP", "a_compiler:warm_up")
    yield made
    for each in made:
        each.ends.set()


async def _until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(60.0):
        while not condition():
            await asyncio.sleep(0.01)


@pytest.fixture
def nothing_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a_compiler.py").write_text("def warm_up():\n    return False\n")
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("nothing_left")
async def test_scans_are_taken_while_kernels_are_compiled(
    tmp_path: Path, compiler: list[_FakeCompiler], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    engine = LocalEngine(1, mapper="fake_mapper:FakeMapper", warm_up="a_compiler:warm_up")
    service = Service(Settings(data_dir=tmp_path / "data"), engine=engine)
    await service.start()
    transport = httpx.ASGITransport(create_app(service=service))
    async with httpx.AsyncClient(transport=transport, base_url="http://lineloom") as client:
        await _until(lambda: engine._compilation.reasons() != [])
        compiler[-1].report(Progress(1, 3, "graph", maps=False))
        ready = await client.get("/readyz")
        assert ready.status_code == 200
        assert (ready.json()["takes_scans"], ready.json()["maps"]) == (True, False)
        assert "kernels are being compiled: 1 of 3, now graph" in ready.json()["reasons"]
        maps = await client.get("/readyz?maps=true")
        assert (maps.status_code, maps.headers["retry-after"]) == (503, "1")
        assert {**maps.json(), **ready.json()} == maps.json()
        assert engine.pids == []
        taken = await client.post("/v1/sites/s/robots/r/scans", json=SCAN)
        assert taken.status_code == 202

        compiler[-1].report(Progress(2, 3, "places", maps=True))
        await _until(lambda: not service.not_ready())
        assert (await client.get("/readyz?maps=true")).status_code == 200
        await _until(lambda: service.conductor.published(1).position == 1)
    await service.stop()
    assert compiler[-1].stopped
    assert service.readiness().takes_scans is False
    assert "compiling kernels: " in caplog.text


@pytest.mark.usefixtures("nothing_left")
async def test_where_nothing_can_be_kept_workers_compile_and_the_log_says_what_to_set(
    compiler: list[_FakeCompiler],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(compilation, "can_keep", lambda: False)
    engine = LocalEngine(1, mapper="fake_mapper:FakeMapper", warm_up="a_compiler:warm_up")
    await engine.start()
    try:
        await _until(lambda: not engine.not_ready())
        assert not compiler[-1].ends.is_set()
        assert "LINELOOM_KERNEL_CACHE" in caplog.text
    finally:
        await engine.stop()


@pytest.mark.usefixtures("nothing_left")
async def test_workers_compile_by_themselves_where_that_fails(
    compiler: list[_FakeCompiler], caplog: pytest.LogCaptureFixture
) -> None:
    engine = LocalEngine(1, mapper="fake_mapper:FakeMapper", warm_up="a_compiler:warm_up")
    await engine.start()
    try:
        await _until(lambda: engine._compilation.reasons() != [])
        compiler[-1].failure = RuntimeError("no room")
        compiler[-1].ends.set()
        await _until(lambda: not engine.not_ready())
        assert "each worker compiles them by itself" in caplog.text
    finally:
        await engine.stop()
