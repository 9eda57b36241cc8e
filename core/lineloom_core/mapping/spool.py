"""Bytes that are seldom asked for: on the disk and not in memory."""

from __future__ import annotations

import tempfile
from typing import IO


class Spool:
    """Blocks in a file without a name, gone with its process; numbered from 0.

    Where the disk takes no more (see `tempfile` for where that is), they stay in memory.
    """

    def __init__(self) -> None:
        self._file: IO[bytes] | None = None
        self._where: list[tuple[int, int] | bytes] = []
        self._end = 0

    def __len__(self) -> int:
        return len(self._where)

    def append(self, block: bytes) -> None:
        """Add a block."""
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(prefix="lineloom-")  # noqa: SIM115
            self._file.seek(self._end)
            self._file.write(block)
            self._file.flush()
        except OSError:
            self._where.append(block)
        else:
            self._where.append((self._end, len(block)))
            self._end += len(block)

    def __getitem__(self, number: int) -> bytes:
        """Read a block. Raises IndexError for one that is not there."""
        where = self._where[number]
        if isinstance(where, bytes):
            return where
        assert self._file is not None
        self._file.seek(where[0])
        return self._file.read(where[1])
