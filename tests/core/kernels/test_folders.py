"""Where machine code is kept, and for how long."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from lineloom_core.kernels import folders


@pytest.fixture(autouse=True)
def _looked_for_anew(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    folders.writable.cache_clear()
    for name in (folders.SETTING, "NUMBA_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    (tmp_path / "tmp").mkdir()
    yield
    folders.writable.cache_clear()


def _block(path: Path) -> None:
    path.write_text("")  # root may write anywhere, but not below a file


def test_the_setting_goes_before_all_and_need_not_be_writable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _block(tmp_path / "barred")
    monkeypatch.setenv(folders.SETTING, str(tmp_path / "barred/x"))
    assert folders.writable() == tmp_path / "barred/x"
    assert not folders.can_keep()


def test_the_first_place_that_can_be_written_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
    assert folders.writable() == tmp_path / "numba/lineloom/kernels"
    _block(tmp_path / "numba")
    folders.writable.cache_clear()
    assert folders.writable() == tmp_path / "user/lineloom/kernels"
    _block(tmp_path / "user")
    folders.writable.cache_clear()
    found = folders.writable()
    assert found is not None
    assert found.parent == tmp_path / "tmp"
    assert found.stat().st_mode & 0o777 == 0o700
    assert folders.can_keep()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders belong to nobody here")
def test_a_folder_that_others_may_write_in_is_not_run_from(tmp_path: Path) -> None:
    _block(tmp_path / "user")
    folder = tmp_path / "tmp" / f"lineloom-kernels-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    assert folders.writable() is None
    assert not folders.can_keep()
    folder.rmdir()
    folder.symlink_to(tmp_path)
    folders.writable.cache_clear()
    assert folders.writable() is None


def test_old_folders_go_and_used_ones_stay(tmp_path: Path) -> None:
    now = time.time()
    ages = {"cpu/m.a-1": 5.0, "cpu/m.a-2": 4.0, "cpu/m.a-3": 3.0, "cpu/m.a-4": 2.0}
    ages |= {"cpu/m.b-1": 9.0, "gone/m.a-1": 40.0, "gone/m.b-1": 31.0, "other/m.a-1": 29.0}
    for name, days in ages.items():
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "f.nbc").write_text("")
        os.utime(tmp_path / name, (now - days * 86_400.0,) * 2)
    folders.mark_used(tmp_path / "cpu/m.a-1")
    new = tmp_path / "cpu/m.a-5"
    new.mkdir()
    folders.clean_up(new)
    left = sorted(str(f.relative_to(tmp_path)) for f in tmp_path.glob("*/m.*"))
    assert left == ["cpu/m.a-1", "cpu/m.a-3", "cpu/m.a-4", "cpu/m.a-5", "cpu/m.b-1", "other/m.a-1"]
    assert not (tmp_path / "gone").exists()
