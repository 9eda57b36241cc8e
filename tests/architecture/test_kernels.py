"""Every kernel is compiled by the one decorator, whose cache looks at all that it is made of."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from lineloom_core.kernels.sources import kernel_files

ROOT = Path(__file__).parents[2]
PACKAGES = {"lineloom_core": ROOT / "core", "lineloom_lab": ROOT / "core"}
OTHERS = (ROOT / "service", ROOT / "clients")
OWN = ROOT / "core/lineloom_core/kernels"


def _imports_compiler(text: str) -> bool:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import) and any(a.name.startswith("numba") for a in node.names):
            return True
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("numba"):
            return not {alias.name for alias in node.names} <= {"typeof", "types"}
    return False


def _files() -> list[Path]:
    folders = [*(root / package for package, root in PACKAGES.items()), *OTHERS]
    return [file for folder in folders for file in sorted(folder.rglob("*.py"))]


def test_nothing_is_compiled_past_the_cache() -> None:
    """Whoever wants numba's own decorators would have kernels whose sources nobody looks at."""
    found = [f for f in _files() if _imports_compiler(f.read_text()) and f.parent != OWN]
    # Whether numba works at all.
    assert found == [ROOT / "clients/python/lineloom/cli/check_installation.py"]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_file_with_a_kernel_is_found(package: str) -> None:
    decorated = re.compile(r"^@kernel\b", re.MULTILINE)
    files = (PACKAGES[package] / package).rglob("*.py")
    expected = sorted(f for f in files if decorated.search(f.read_text()))
    assert expected
    assert kernel_files(package) == expected


def test_the_search_bites() -> None:
    assert _imports_compiler("from numba import njit")
    assert _imports_compiler("def f():\n    import numba.core as n")
    assert not _imports_compiler("from lineloom_core.kernels import kernel")
    assert not _imports_compiler("from numba import types")
