"""What CONTRIBUTING.md shows how to add is found wherever it is needed."""

from __future__ import annotations

import importlib
import pkgutil
import re

import lineloom_core.io
from lineloom.cli.map import Format
from lineloom.cli.scan_files import LOG_FORMATS
from lineloom.wire import MAP_FORMATS, ExportRequest
from lineloom_service.settings import Settings

from tests.docs.pages import ROOT

FORMATS_PAGE = (ROOT / "core" / "docs" / "formats.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
APART = {"json", "nav2"}
"""Written by the service itself, and of a grid."""


def modules_with(function: str) -> set[str]:
    """Names of the formats whose module has a function."""
    names = [m.name for m in pkgutil.iter_modules(lineloom_core.io.__path__)]
    return {n for n in names if hasattr(importlib.import_module(f"lineloom_core.io.{n}"), function)}


def test_every_format_of_maps_has_a_writer_a_row_and_a_word_in_the_docs() -> None:
    assert modules_with("write_map") | APART == set(MAP_FORMATS)
    assert [name for name in MAP_FORMATS if f"`{name}`" not in FORMATS_PAGE] == []


def test_every_format_of_maps_is_in_exports_and_on_the_command_line() -> None:
    assert [form.value for form in Format] == list(MAP_FORMATS)
    schema = ExportRequest.model_json_schema()["properties"]["format"]
    assert schema["enum"] == list(MAP_FORMATS)


def test_every_format_of_recordings_has_a_reader_a_row_and_a_word_in_the_docs() -> None:
    assert modules_with("read_log") | {"jsonl"} == set(LOG_FORMATS)
    assert [name for name in LOG_FORMATS if f"| `{name}` |" not in FORMATS_PAGE] == []


def test_every_setting_has_a_row_in_the_docs() -> None:
    page = (ROOT / "service" / "README.md").read_text(encoding="utf-8")
    assert [f for f in Settings.model_fields if f"`LINELOOM_{f.upper()}`" not in page] == []


def test_the_files_that_contributing_names_are_there() -> None:
    named = re.findall(r"`((?:core|service|clients|tests)/[\w./]+\.\w+)`", CONTRIBUTING)
    assert len(named) >= 8, "the search for names is broken"
    assert [name for name in named if not (ROOT / name).exists()] == []
