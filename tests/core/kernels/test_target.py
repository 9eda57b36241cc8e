"""For which processor is compiled, and what tells two targets apart."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import lineloom_core
import pytest
from lineloom_core.kernels import kernel_target, sources, target

TELL = """
from lineloom_core.kernels import kernel_target
from lineloom_core.kernels.target import target_name
print(target_name(), kernel_target())
"""
LATE = "from numba import njit\nnjit(lambda x: x + 1)(1)\n"


def _tell(code: str = TELL, **environment: str) -> subprocess.CompletedProcess[str]:
    inherited = {
        k: v for k, v in os.environ.items() if k not in ("NUMBA_CPU_NAME", "LINELOOM_KERNELS")
    }
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**inherited, "PYTHONPATH": os.pathsep.join(sys.path), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_each_processor_has_a_target_of_its_own() -> None:
    native, generic = _tell(LINELOOM_KERNELS="native"), _tell(LINELOOM_KERNELS="generic")
    assert generic.stdout.startswith("generic-")
    assert not native.stdout.startswith("generic-")
    assert native.stdout.split()[1] != generic.stdout.split()[1]
    by_numba = _tell(LINELOOM_KERNELS="native", NUMBA_CPU_NAME="generic")
    assert by_numba.stdout == generic.stdout


def test_what_came_with_a_wheel_is_used_unless_told_otherwise(tmp_path: Path) -> None:
    package = Path(lineloom_core.__file__).parent
    wheel = shutil.copytree(package, tmp_path / "lineloom_core")
    generic = _tell(LINELOOM_KERNELS="generic").stdout.split()[0]
    path = os.pathsep.join([str(tmp_path), *sys.path])
    assert not _tell(PYTHONPATH=path).stdout.startswith("generic-")
    (wheel / "_compiled" / generic).mkdir(parents=True)
    assert _tell(PYTHONPATH=path).stdout.split()[0] == generic
    assert not _tell(PYTHONPATH=path, LINELOOM_KERNELS="native").stdout.startswith("generic-")


def test_nonsense_is_refused_and_named() -> None:
    told = _tell(LINELOOM_KERNELS="fast").stderr
    assert "LINELOOM_KERNELS must be native, generic or auto, not 'fast'" in told


def test_a_choice_that_comes_too_late_is_said() -> None:
    told = _tell(LATE + TELL, LINELOOM_KERNELS="generic")
    assert not told.stdout.startswith("generic-")
    assert "too late" in told.stderr


def test_a_target_is_of_all_sources(monkeypatch: pytest.MonkeyPatch) -> None:
    before = kernel_target()
    assert kernel_target() == before != kernel_target("lineloom_lab")
    monkeypatch.setattr(target, "digest_of", sources.digest_of.__wrapped__)  # told anew
    assert kernel_target() == before
    monkeypatch.setattr(sources, "_contents", lambda file: file.name)
    assert kernel_target() != before
