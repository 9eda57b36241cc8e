"""Nothing that runs code when it is read, and no evaluation of text, in what is installed."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("core/lineloom_core", "service/lineloom_service", "clients")

MODULES = {"pickle", "_pickle", "shelve", "marshal", "dill", "cloudpickle", "joblib", "dbm"}
CALLS = {"eval", "exec", "compile"}
PIPES = {"send", "recv"}
"""Of `multiprocessing.Connection`: they pickle; `send_bytes` and `recv_bytes` do not."""


def complaints(text: str) -> Iterator[str]:
    """What in a source file would run what others wrote."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.split(".")[0] in MODULES)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in MODULES:
            yield node.module or ""
        elif isinstance(node, ast.Call):
            yield from _call(node)


def _call(node: ast.Call) -> Iterator[str]:
    called = node.func
    if isinstance(called, ast.Name) and called.id in CALLS:
        yield called.id
    if isinstance(called, ast.Attribute) and called.attr in PIPES:
        owner = ast.unparse(called.value)
        if owner.endswith("connection"):
            yield f"{owner}.{called.attr}"
    for keyword in node.keywords:
        if keyword.arg == "allow_pickle" and getattr(keyword.value, "value", True) is not False:
            yield "allow_pickle"


def test_nothing_that_is_installed_reads_code() -> None:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    assert len(files) > 300, "the search for files is broken"
    found = {
        path.relative_to(ROOT).as_posix(): wrong
        for path in files
        if (wrong := list(complaints(path.read_text(encoding="utf-8"))))
    }
    assert found == {}


@pytest.mark.parametrize(
    "text",
    [
        "import pickle",
        "import numpy, pickle as p",
        "from pickle import loads",
        "import shelve",
        "def f():\n    import marshal",
        "eval('1')",
        "self._connection.recv()",
        "np.load(path, allow_pickle=True)",
        "np.load(path, allow_pickle=yes)",
    ],
)
def test_the_search_finds_it(text: str) -> None:
    assert list(complaints(text))


def test_the_search_does_not_cry_wolf() -> None:
    text = "connection.recv_bytes()\nnp.load(p, allow_pickle=False)\nre.compile('x')\npickled = 1"
    assert list(complaints(text)) == []
