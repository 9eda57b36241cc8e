"""Which files a kernel's machine code is made of, by their contents and not by their dates."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

OWN = "lineloom_core.kernels"
"""Not a source itself: what of it shapes machine code, its options, is part of the target."""

_DEFINES_KERNELS = re.compile(rf"^from {re.escape(OWN)} import .*\bkernel\b", re.MULTILINE)


def kernel_files(package: str) -> list[Path]:
    """Return every file of a top-level package that defines kernels, sorted."""
    root = _root(package)
    files = sorted(root.rglob("*.py")) if root is not None else []
    return [file for file in files if _DEFINES_KERNELS.search(file.read_text(encoding="utf-8"))]


@cache
def digest_of(module: str) -> str:
    """Return a hash of a module's file and of all that it imports of its own distribution.

    Compiled code holds the code of other files' functions and the values of their constants.
    """
    found: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        file = _file_of(name, module)
        if file is not None and name not in found:
            found[name] = file
            waiting += _imports(file)
    digest = sha256()
    for name in sorted(found):
        digest.update(f"{name}\0{_contents(found[name])}\0".encode())
    return digest.hexdigest()


def module_name(file: Path, package: str) -> str:
    """Return the dotted name of a file of a package. Raises ValueError where it is not in it."""
    root = _root(package)
    if root is None:
        raise ValueError(f"there is no package {package!r}")
    parts = file.relative_to(root.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _file_of(name: str, module: str) -> Path | None:
    """Return a module's file where it is ours: of `module`'s package or of the core."""
    top = name.partition(".")[0]
    if top not in (module.partition(".")[0], OWN.partition(".")[0]) or name.startswith(OWN):
        return None
    root = _root(top)
    if root is None:
        return None
    path = root.parent.joinpath(*name.split("."))
    files = (path.with_suffix(".py"), path / "__init__.py")
    return next((file for file in files if file.is_file()), None)


@cache
def _root(package: str) -> Path | None:
    spec = find_spec(package)
    places = spec.submodule_search_locations if spec is not None else None
    return Path(next(iter(places))) if places else None


@cache
def _contents(file: Path) -> str:
    return sha256(file.read_bytes()).hexdigest()


@cache
def _imports(file: Path) -> tuple[str, ...]:
    return tuple(_imported(ast.parse(file.read_bytes())))


def _imported(tree: ast.Module) -> Iterator[str]:
    """Yield names of modules, and of what may be a module, that a file imports as it is loaded."""
    for node in tree.body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise ValueError(
                    "kernels import by whole names: what they are made of is looked up"
                )
            yield str(node.module)
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
