"""core/docs/thesis.md names only what exists, and all of chapters 3 to 5."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "core" / "lineloom_core"
LAB = ROOT / "core" / "lineloom_lab"
THESIS = PACKAGE / "matching" / "thesis"
TEXT = (ROOT / "core" / "docs" / "thesis.md").read_text(encoding="utf-8")
SOURCE = "\n".join(
    file.read_text(encoding="utf-8")
    for folder in (THESIS, LAB / "evaluation", LAB / "simulation", PACKAGE / "scan")
    for file in sorted(folder.glob("*.py"))
)
TESTS = "\n".join(
    file.read_text(encoding="utf-8")
    for file in sorted((ROOT / "tests" / "core").rglob("test_*.py"))
)
QUOTED = re.findall(r"`([^`]+)`", TEXT)


def test_every_file_it_names_exists() -> None:
    files = {q for q in QUOTED if q.endswith(".py")}
    homes = (THESIS, PACKAGE, LAB, Path(__file__).parent, ROOT)
    missing = sorted(f for f in files if not any((home / f).exists() for home in homes))
    assert not missing


def test_every_test_it_names_exists() -> None:
    names = {q for q in QUOTED if q.startswith("test_") and not q.endswith(".py")}
    assert len(names) >= 10
    assert not sorted(name for name in names if f"def {name}(" not in TESTS)


def test_every_function_and_class_it_names_exists() -> None:
    """Dotted and plain Python names in the tables; the last part must be defined somewhere."""
    tables = "\n".join(line for line in TEXT.splitlines() if line.startswith("|"))
    names = {
        q.split(".")[-1]
        for q in re.findall(r"`([A-Za-z_.]+)`", tables)
        if not q.endswith(".py") and not q.startswith("test_")
    }
    missing = sorted(n for n in names if not re.search(rf"\b{re.escape(n)}\b", SOURCE))
    assert not missing


def test_nothing_of_chapters_3_to_5_is_left_out() -> None:
    for number in range(1, 12):
        assert f"| {number} " in TEXT
    sections = ("3.2", "3.3", "4.1.1", "4.1.2", "4.1.3", "4.2", "4.3", "4.4", "4.5", "6.3")
    for section in (*sections, "5.1", "5.2", "5.3", "5.4", "5.5", "5.6.1", "5.6.2", "5.7", "5.8"):
        assert f"| {section} " in TEXT, section
