"""Where a SQLite file lies: whether it is still there, and whether there is room for more."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path

from lineloom_service.store.records import StoreError

_MAGIC = b"SQLite format 3\0"
_ROOM = 1024 * 1024
"""A few scans, in the file and in its journal."""

_CANNOT_TELL = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS)


class SqlitePlace:
    """The place of one file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: tuple[int, int] | None = None

    def remember(self) -> None:
        """Know the file again: it is the one that is open from now on."""
        found = self._path.stat()
        self._file = (found.st_dev, found.st_ino)

    def check(self) -> None:
        """Raises StoreError where the file is another one or none, OSError where it is full."""
        try:
            found = self._path.stat()
            with self._path.open("rb") as file:
                begin = file.read(len(_MAGIC))
        except FileNotFoundError:
            raise StoreError("the database file was removed") from None
        if (found.st_dev, found.st_ino) != self._file:
            raise StoreError("the database file was replaced by another one")
        if begin != _MAGIC:
            raise StoreError("the database file is no database any more")
        self._take_room()

    def _take_room(self) -> None:
        if not hasattr(os, "posix_fallocate"):
            return
        with tempfile.TemporaryFile(dir=self._path.parent) as file:
            try:
                os.posix_fallocate(file.fileno(), 0, _ROOM)
            except OSError as error:
                if error.errno not in _CANNOT_TELL:
                    raise
