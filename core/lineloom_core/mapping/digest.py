"""What a map was made with, as a short text: another one means another map of the same log.

Its parts are the making (source code of all that the mapper runs, the libraries that compute for
it, the processor that kernels are compiled for) and the parameters by name.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib.metadata import version
from pathlib import Path

import lineloom_core
from lineloom_core.kernels.target import target_name
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.parameters import values

NOT_RUN = ("io/", "floorplan/", "warm_up/")
"""What of this package the mapper does without; a test holds it to what it imports."""

_LIBRARIES = ("numpy", "scipy", "gtsam")


def digest(config: MapperConfig) -> str:
    """Return `making.parameters`, 16 hexadecimal digits each."""
    canonical = json.dumps(values(config), sort_keys=True, separators=(",", ":"))
    return f"{making()}.{_short(canonical.encode())}"


@cache
def making() -> str:
    """Return the part that is the same for all parameters."""
    target = [*(f"{name} {version(name)}" for name in _LIBRARIES), target_name()]
    return _short("\n".join((code_digest(Path(lineloom_core.__file__).parent), *target)).encode())


def code_digest(package: Path) -> str:
    """Return a digest of the source files in a folder of this package, `NOT_RUN` left out."""
    found = hashlib.sha256()
    names = sorted(path.relative_to(package).as_posix() for path in package.rglob("*.py"))
    for name in names:
        if not name.startswith(NOT_RUN):
            found.update(f"{name}\0".encode() + (package / name).read_bytes() + b"\0")
    if not names:
        raise RuntimeError(f"{package} has no source files, so maps cannot be told apart")
    return found.hexdigest()


def _short(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
