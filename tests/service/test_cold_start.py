"""The first start of all: who has compiled kernels does not keep the compiler."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Literal

import pytest
from lineloom_core.warm_up import warm_up
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
