"""Only one service has a directory."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from typing import IO

from lineloom_service.store.records import StoreError


class DirectoryLock:
    """Keeps a second service off the same directory: there is one writer.

    The kernel lets go of it when the process ends, however it ends.
    """

    def __init__(self, directory: Path) -> None:
        self._path = directory / "lock"
        self._file: IO[str] | None = None

    def acquire(self) -> None:
        """Take the lock or raise StoreError."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            file = self._path.open("a+")
        except OSError as error:
            raise StoreError(f"cannot use {self._path.parent}: {error.strerror}") from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.seek(0)
            owner = file.read().strip() or "unknown"
            file.close()
            raise StoreError(
                f"another Lineloom service uses {self._path.parent} (process {owner})"
            ) from error
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        self._file = file

    def release(self) -> None:
        """Let go."""
        if self._file is not None:
            self._file.close()
            self._file = None
