"""The client needs no newer Python than its package says: ROS 2 Humble's is 3.10."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

CLIENT = Path(__file__).parents[2] / "clients" / "python"

NEWER = {
    ("asyncio", "Runner"),
    ("asyncio", "TaskGroup"),
    ("asyncio", "timeout"),
    ("datetime", "UTC"),
    ("enum", "StrEnum"),
    ("hashlib", "file_digest"),
    ("typing", "Never"),
    ("typing", "Self"),
    ("typing", "assert_never"),
    ("typing", "override"),
}
"""What the standard library has since 3.11 or 3.12."""


def newer(text: str) -> Iterator[str]:
    """What of it a module uses."""
    for node in ast.walk(ast.parse(text, feature_version=(3, 10))):
        if isinstance(node, ast.ImportFrom):
            found = {(node.module, alias.name) for alias in node.names} & NEWER
            yield from (f"{module}.{name}" for module, name in found)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if (node.value.id, node.attr) in NEWER:
                yield f"{node.value.id}.{node.attr}"
        elif isinstance(node, ast.TryStar):
            yield "except*"


def test_the_package_says_3_10() -> None:
    text = (CLIENT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.search(r'^requires-python = ">=3\.10"$', text, re.MULTILINE)


def test_nothing_newer_is_used() -> None:
    paths = sorted((CLIENT / "lineloom").rglob("*.py"))
    assert len(paths) > 60, "the search for files is broken"
    found = {str(path): list(newer(path.read_text(encoding="utf-8"))) for path in paths}
    assert {path: names for path, names in found.items() if names} == {}


def test_the_search_finds_what_is_newer() -> None:
    text = "from enum import StrEnum\nimport datetime\nnow = datetime.UTC\n"
    assert sorted(newer(text)) == ["datetime.UTC", "enum.StrEnum"]
