"""What keeps the code readable: small files, small functions, docstrings, and no loose ends."""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.conftest import SLOWEST_FIRST

ROOT = Path(__file__).parents[2]
PACKAGES = ("core/", "service/", "clients/")

MOST_LINES = 400
MOST_BODY_LINES = 60
MOST_KERNEL_LINES = 800
"""Kernels that call each other share a file: numba caches per file, and inlines within one."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


@cache
def committed() -> tuple[str, ...]:
    """Paths of all files that git knows, or a skip where this is no checkout."""
    try:
        listed = subprocess.run(
            ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        pytest.skip(f"{ROOT} is no git checkout: what is committed is not known")
    return tuple(p for p in listed.stdout.split("\0") if p and (ROOT / p).is_file())


def python_files(*prefixes: str) -> list[str]:
    chosen = [p for p in committed() if p.endswith(".py") and p.startswith(prefixes or "")]
    assert len(chosen) > 20, "the search for files is broken"
    return chosen


def text_of(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def is_kernel(path: str) -> bool:
    return Path(path).name.endswith("_kernels.py")


def too_long(path: str, text: str) -> str | None:
    lines, most = len(text.splitlines()), MOST_KERNEL_LINES if is_kernel(path) else MOST_LINES
    return f"{path}: {lines} lines, at most {most}" if lines > most else None


def body_lines(function: Function) -> int:
    """Lines of the body, docstring aside: a command's options are its signature, not its logic."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    if not body:
        return 0
    return (body[-1].end_lineno or 0) - body[0].lineno + 1


def long_functions(path: str, text: str) -> list[str]:
    return [
        f"{path}:{node.lineno}: {node.name} has {body_lines(node)} lines, at most {MOST_BODY_LINES}"
        for node in ast.walk(ast.parse(text))
        if isinstance(node, Function) and body_lines(node) > MOST_BODY_LINES
    ]


def undocumented(path: str, text: str) -> Iterator[str]:
    """Public modules, classes, functions and methods without a docstring."""
    module = ast.parse(text)
    if module.body and ast.get_docstring(module) is None:
        yield f"{path}: the module"
    for node in module.body:
        yield from _undocumented_in(path, node, "")


def _undocumented_in(path: str, node: ast.stmt, owner: str) -> Iterator[str]:
    if not isinstance(node, Function | ast.ClassDef) or node.name.startswith("_"):
        return
    if ast.get_docstring(node) is None and not _is_overload(node):
        yield f"{path}:{node.lineno}: {owner}{node.name}"
    if isinstance(node, ast.ClassDef):
        for inner in node.body:
            if _is_protocol(node) and _is_stub(inner):
                continue  # its name and type are all there is to it; the class says the rest
            yield from _undocumented_in(path, inner, f"{node.name}.")


def _is_overload(node: Function | ast.ClassDef) -> bool:
    return any(isinstance(d, ast.Name) and d.id == "overload" for d in node.decorator_list)


def _is_protocol(node: ast.ClassDef) -> bool:
    names = [base.value if isinstance(base, ast.Subscript) else base for base in node.bases]
    return any(isinstance(name, ast.Name) and name.id == "Protocol" for name in names)


def _is_stub(node: ast.stmt) -> bool:
    return isinstance(node, Function) and ast.unparse(node.body[-1]) == "..."


# Split, so that this file does not find itself.
REGISTRY = re.compile(
    "|".join(
        [
            r"pypi" r"\.(org|python)",
            r"files\.python" r"hosted",
            r"registry\.(npm" r"js|yarn" r"pkg)",
            r"proxy\.go" r"lang",
            r"(extra-)?index" r"-url",
            r"find" r"-links",
            r"file:/" r"//",
            r"https?://[^\s\"'<>]*/simp" r"le\b",
            r"arti" r"factory|jf" r"rog",
        ]
    ),
    re.IGNORECASE,
)


def test_no_file_is_too_long() -> None:
    found = [complaint for p in python_files() if (complaint := too_long(p, text_of(p)))]
    assert found == []


def test_no_function_is_too_long() -> None:
    found = [f for p in python_files() if not is_kernel(p) for f in long_functions(p, text_of(p))]
    assert found == []


def test_everything_public_says_what_it_is() -> None:
    found = [u for p in python_files(*PACKAGES) for u in undocumented(p, text_of(p))]
    assert found == []


def test_no_file_is_a_drawer_for_anything() -> None:
    names = {"utils.py", "util.py", "helpers.py", "misc.py", "common.py"}
    assert [p for p in committed() if Path(p).name in names] == []


def test_no_registry_address_is_committed() -> None:
    found = []
    for path in committed():
        content = (ROOT / path).read_bytes()
        if b"\0" in content:
            continue  # a picture
        for number, line in enumerate(content.decode("utf-8", "replace").splitlines(), start=1):
            if REGISTRY.search(line):
                found.append(f"{path}:{number}: {line.strip()[:100]}")
    assert found == []


def test_constraints_are_exact_versions_and_nothing_else() -> None:
    lines = [line for line in text_of("constraints.txt").splitlines() if line.strip()]
    pinned = [line for line in lines if not line.startswith("#")]
    assert len(pinned) > 20
    assert [p for p in pinned if not re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+!]+", p)] == []


def test_no_lock_file_and_no_data_is_committed() -> None:
    barred = {"uv.lock", "poetry.lock", "package-lock.json", "yarn.lock"}
    assert [p for p in committed() if Path(p).name in barred] == []
    largest = max(committed(), key=lambda p: (ROOT / p).stat().st_size)
    assert (ROOT / largest).stat().st_size < 2_000_000, largest


SHORT, LONG = "x = 1\n" * MOST_LINES, "x = 1\n" * (MOST_LINES + 1)


def test_the_rules_bite() -> None:
    assert too_long("a.py", SHORT) is None
    assert too_long("a.py", LONG)
    assert too_long("core/_kernels.py", LONG) is None
    function = 'def f():\n    """Doc."""\n'
    assert long_functions("a.py", function + "    x = 1\n" * MOST_BODY_LINES) == []
    assert long_functions("a.py", function + "    x = 1\n" * (MOST_BODY_LINES + 1))
    bare = "class A:\n    def f(self): ...\n    def _g(self): ...\ndef h(): ...\n"
    assert len(list(undocumented("a.py", bare))) == 4
    assert REGISTRY.search("--index" + "-url=x")
    assert REGISTRY.search("https://mirror.example/py" + "pi/simp" + "le/")
    assert not REGISTRY.search("numpy==2.4.0  # a simple pin")


def test_the_files_that_begin_first_are_there() -> None:
    assert len(SLOWEST_FIRST) > 5
    assert [name for name in SLOWEST_FIRST if f"tests/{name}" not in committed()] == []
