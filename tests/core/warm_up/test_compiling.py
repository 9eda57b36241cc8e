"""Several processes compile what the table says, and leave a mark when all of it is there."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from lineloom_core.kernels import folders
from lineloom_core.warm_up import compiling
from lineloom_core.warm_up.compiling import Compiler, Progress, is_compiled
from lineloom_core.warm_up.specialisations import Specialisation

THIN = Specialisation("matching._registration_kernels.thin", "F2 f i")
NORMALS = Specialisation("features._kernels.point_normals", "F2 B1 i")
EXTENTS = Specialisation("fusion._kernels.extents", "F2 I1 F2")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache, and a table of three small kernels."""
    monkeypatch.setenv(folders.SETTING, str(tmp_path))
    monkeypatch.setattr(compiling, "MAPPING", (THIN, NORMALS))
    monkeypatch.setattr(compiling, "REST", (EXTENTS,))
    folders.writable.cache_clear()
    yield tmp_path
    folders.writable.cache_clear()


def test_all_is_compiled_once_and_mapping_first(cache: Path) -> None:
    told: list[Progress] = []
    assert not is_compiled()
    Compiler(told.append, processes=2).run()
    assert is_compiled()
    names = [file.name.partition("-")[0] for file in cache.rglob("*.nbc")]
    assert {"thin", "point_normals", "extents"} <= set(names)
    assert len(names) == len(set(names))
    assert not list(cache.rglob("*.lock"))
    assert [p.maps for p in told] == sorted(p.maps for p in told)
    assert (told[-1].done, told[-1].of, told[-1].maps) == (3, 3, True)
    assert str(told[0]) == "0 of 3, now matching"

    files = {file: file.stat().st_mtime_ns for file in cache.rglob("*.nbc")}
    Compiler(processes=1).run()
    assert {file: file.stat().st_mtime_ns for file in cache.rglob("*.nbc")} == files


def test_one_that_fails_is_an_error_and_leaves_no_mark(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "MAPPING", (Specialisation("features._kernels.no", "f"),))
    with pytest.raises(RuntimeError, match="ended with 1"):
        Compiler(processes=1).run()
    assert not is_compiled()


def test_stopped_it_ends_at_once_and_leaves_no_mark() -> None:
    begun = threading.Event()
    compiler = Compiler(lambda _: begun.set(), processes=2)
    thread = threading.Thread(target=compiler.run)
    thread.start()
    assert begun.wait(60.0)
    compiler.stop()
    thread.join(30.0)
    assert not thread.is_alive()
    assert not is_compiled()
