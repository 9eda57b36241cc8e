"""Machine code on the disk, found by all that it was made of."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

from lineloom_core.kernels import folders
from lineloom_core.kernels.sources import digest_of
from lineloom_core.kernels.target import target_name

_LOG = logging.getLogger(__name__)


class KernelCache(FunctionCache):
    """Numba's cache in folders of our own: `<place>/<target>/<module>-<hash of its sources>`."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._name = repr(function)
        self._py_func = function
        self._impl = _Naming(function)
        self._cache_path = self._impl.locator.get_cache_path()
        self._cache_file = _Files(function.__module__, self._impl.filename_base)
        self.enable()

    def _index_key(self, sig: Any, codegen: Any) -> tuple[str, str]:
        # A named tuple's type does not know the order of its fields.
        fields = [getattr(t, "fields", None) for t in sig]
        return repr(sig), repr((fields, super()._index_key(sig, codegen)[1:]))


class _Naming(CompileResultCacheImpl):
    """What numba asks a locator of files for, without its search for places."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._py_file = function.__code__.co_filename
        self._lineno = function.__code__.co_firstlineno
        self._locator = self
        self._filename_base = f"{function.__qualname__}-{self._lineno}"

    def get_cache_path(self) -> str:
        """Return where machine code is kept, as numba's own tools tell it."""
        return str(folders.writable() or "")

    def ensure_cache_path(self) -> None:
        """Leave that to the saving."""


class _Files(IndexDataCacheFile):
    """A file for every specialisation, and no index.

    Processes that compile at the same time lose entries of numba's index, or find another's
    machine code under their signature.
    """

    def __init__(self, module: str, base: str) -> None:
        name = Path(target_name(), f"{module}-{digest_of(module)[:16]}")
        place = folders.writable()
        self._own = None if place is None else place / name
        self._shipped = folders.shipped(module.partition(".")[0]) / name
        self._base = base

    def load(self, key: tuple[str, str]) -> Any:
        """Return what was compiled for a signature, None where there is nothing of use."""
        for folder in (self._own, self._shipped):
            if folder is None or not (path := folder / self._file(key)).is_file():
                continue
            try:
                found, data = self._load_data(path)
            except Exception as error:  # whatever a torn file leads to
                _LOG.warning("%s is unreadable and compiled again: %r", path, error)
                continue
            if found == key:
                folders.mark_used(folder)
                return data
        return None

    def save(self, key: tuple[str, str], data: Any) -> None:
        """Keep what was compiled, or say once what to set so that it can be kept."""
        if self._own is None:
            _tell("no folder can be written")
            return
        try:
            if not self._own.is_dir():
                self._own.mkdir(parents=True, exist_ok=True)
                folders.clean_up(self._own)
            self._save_data(self._own / self._file(key), (key, data))
        except OSError as error:
            _tell(f"{folders.writable()}: {error.strerror}")

    def _file(self, key: tuple[str, str]) -> str:
        return f"{self._base}-{sha256(repr(key).encode()).hexdigest()[:16]}.nbc"

    def _data_path(self, name: Path) -> str:
        return str(name)


@cache
def _tell(reason: str) -> None:
    _LOG.warning(
        "compiled kernels cannot be kept (%s): every start compiles them again, for minutes; "
        "set %s to a folder that can be written",
        reason,
        folders.SETTING,
    )
