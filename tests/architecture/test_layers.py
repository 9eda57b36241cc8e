"""The import contracts of pyproject.toml hold, statically and in a running interpreter."""

from __future__ import annotations

import logging
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from importlinter.cli import lint_imports

ROOT = Path(__file__).parents[2]

BROKEN_ON_PURPOSE = """
[tool.importlinter]
root_packages = ["lineloom_core"]
[[tool.importlinter.contracts]]
name = "A contract that the core breaks"
type = "forbidden"
source_modules = ["lineloom_core.matching"]
forbidden_modules = ["lineloom_core.features"]
"""


@pytest.fixture(autouse=True)
def _loggers_as_before() -> Iterator[None]:
    """The linter's set-up of logging disables every logger that there is."""
    known = logging.Logger.manager.loggerDict.values()
    before = [(log, log.disabled) for log in known if isinstance(log, logging.Logger)]
    yield
    for log, disabled in before:
        log.disabled = disabled


def test_no_import_breaks_a_contract(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    status = lint_imports(str(ROOT / "pyproject.toml"), no_cache=True, no_logo=True)
    report = capsys.readouterr().out
    assert status == 0, report
    for name in (
        "Layers of the core",
        "The four rooms of mapping",
        "The core does without",
        "A robot's client needs",
    ):
        assert f"{name}" in report


def test_the_linter_does_find_a_forbidden_import(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    config = tmp_path / "pyproject.toml"
    config.write_text(BROKEN_ON_PURPOSE, encoding="utf-8")
    assert lint_imports(str(config), no_cache=True, no_logo=True) != 0


@pytest.mark.parametrize(
    ("imported", "absent"),
    [
        (
            "lineloom_core.mapping.site_mapper",
            ["fastapi", "starlette", "uvicorn", "httpx", "sqlalchemy", "pydantic"],
        ),
        ("lineloom", ["gtsam", "numba", "lineloom_core", "lineloom_service", "matplotlib"]),
        ("lineloom_service.settings", ["gtsam", "numba"]),
        ("lineloom_core.mapping.answers.view_change", ["gtsam", "numba"]),
        ("lineloom_service.engine.view_record", ["gtsam", "numba"]),
    ],
)
def test_importing_a_part_does_not_pull_in_another(imported: str, absent: list[str]) -> None:
    code = f"import sys, {imported}; print(*(m for m in {absent!r} if m in sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.split() == []
