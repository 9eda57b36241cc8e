"""Machine code on the disk, found by all that it was made of."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from io import BufferedWriter
from pathlib import Path
from typing import Any

try:
    import fcntl
except ImportError:  # no Unix: processes may compile the same at once, and the last one's stays
    fcntl = None  # type: ignore[assignment]

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

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load what was compiled; what another process is compiling just now is waited for."""
        found = super()._load_overload(sig, target_context)
        if found is None and self._cache_file.claim(self._index_key(sig, target_context.codegen())):
            found = super()._load_overload(sig, target_context)
        return found

    @property
    def claims(self) -> int:
        """How many specialisations this process alone may compile now."""
        return len(self._cache_file.claims)

    def release(self, held: int) -> None:
        """Keep so many of the claims, and let others compile the rest."""
        self._cache_file.release(held)

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
        self.claims: list[BufferedWriter] = []

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
            self._make_folder()
            self._save_data(self._own / self._file(key), (key, data))
        except OSError as error:
            _tell(f"{folders.writable()}: {error.strerror}")

    def claim(self, key: tuple[str, str]) -> bool:
        """Be the only process that compiles this; False where that cannot be had."""
        if self._own is None or fcntl is None:
            return False
        with contextlib.suppress(OSError):
            self._make_folder()
            claim = (self._own / f"{self._file(key)}.lock").open("wb")
            fcntl.flock(claim, fcntl.LOCK_EX)
            self.claims.append(claim)
            return True
        return False

    def release(self, held: int) -> None:
        """Give up all claims but the first `held`."""
        while len(self.claims) > held:
            claim = self.claims.pop()
            with contextlib.suppress(OSError):
                Path(claim.name).unlink()
            claim.close()

    def _make_folder(self) -> None:
        if self._own is not None and not self._own.is_dir():
            self._own.mkdir(parents=True, exist_ok=True)
            folders.clean_up(self._own)

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
