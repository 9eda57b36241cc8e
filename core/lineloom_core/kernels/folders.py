"""Where machine code is kept: a folder that can be written, found without being told."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from numba.misc.appdirs import AppDirs

SETTING = "LINELOOM_KERNEL_CACHE"
_KEPT = 4
_UNUSED_S = 30 * 86_400.0
_DAY_S = 86_400.0


@cache
def writable() -> Path | None:
    """Return where machine code is kept, None where nothing can be written.

    LINELOOM_KERNEL_CACHE, else `lineloom` in NUMBA_CACHE_DIR, in the user's folder for caches or,
    for nobody else to write in, in the one for temporary files. The first need not be writable:
    what is in it is used.
    """
    chosen = os.environ.get(SETTING)
    if chosen:
        return Path(chosen).absolute()
    places = [Path(os.environ["NUMBA_CACHE_DIR"])] if os.environ.get("NUMBA_CACHE_DIR") else []
    places.append(Path(AppDirs(appname="", appauthor=False).user_cache_dir))
    for place in places:
        if _can_write(place / "lineloom" / "kernels"):
            return place / "lineloom" / "kernels"
    with contextlib.suppress(OSError):
        user = os.getuid() if hasattr(os, "getuid") else "user"
        place = Path(tempfile.gettempdir()) / f"lineloom-kernels-{user}"
        place.mkdir(mode=0o700, exist_ok=True)
        if _is_ours_alone(place):
            return place
    return None


def can_keep() -> bool:
    """Return whether what is compiled now is found by the next process; tries it."""
    place = writable()
    if place is None:
        return False
    try:
        place.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=place).close()
    except OSError:
        return False
    return True


def shipped(package: str) -> Path:
    """Return the folder of machine code that a wheel brings with it; a source tree has none."""
    spec = find_spec(package)
    places = spec.submodule_search_locations if spec is not None else None
    return Path(next(iter(places or ["."]))) / "_compiled"


def kept(package: str, target: str) -> int:
    """Return how many specialisations are there for a target, brought along or compiled here."""
    return sum(
        1
        for place in (writable(), shipped(package))
        if place is not None
        for _ in (place / target).glob(f"{package}.*/*.nbc")
    )


def mark_used(folder: Path) -> None:
    """Note, at most once a day, that a module's folder is in use."""
    with contextlib.suppress(OSError):
        if time.time() - folder.stat().st_mtime > _DAY_S:
            os.utime(folder)


def clean_up(folder: Path) -> None:
    """Remove what a new module's folder replaces: all but the latest few, all unused for long.

    A process that still uses one compiles again what it misses.
    """
    module = folder.name.rpartition("-")[0]
    others = [(_last_use(f), f) for f in folder.parent.parent.glob("*/*-*/") if f != folder]
    of_module = [f for _, f in sorted(others) if f.name.rpartition("-")[0] == module]
    beside = [f for f in of_module if f.parent == folder.parent]
    unused = [f for used, f in others if used < time.time() - _UNUSED_S]
    for old in {*beside[: 1 - _KEPT], *unused}:
        shutil.rmtree(old, ignore_errors=True)
        with contextlib.suppress(OSError):
            old.parent.rmdir()


def _last_use(folder: Path) -> float:
    with contextlib.suppress(OSError):
        return folder.stat().st_mtime
    return time.time()


def _can_write(place: Path) -> bool:
    while not place.exists() and place != place.parent:
        place = place.parent
    return place.is_dir() and os.access(place, os.W_OK | os.X_OK)


def _is_ours_alone(place: Path) -> bool:
    """Who can write machine code runs it: in a folder for everybody, others must not."""
    if not hasattr(os, "getuid"):
        return True
    found = place.lstat()
    return not place.is_symlink() and found.st_uid == os.getuid() and not found.st_mode & 0o022
