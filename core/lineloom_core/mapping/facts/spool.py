"""Bytes that are seldom asked for: on the disk and not in memory."""

from __future__ import annotations

import tempfile
from collections import deque
from typing import IO

_LITTLE = 1 << 20
"""Bytes of room without use that nobody tidies up."""


class Spool:
    """Blocks in a file without a name, gone with its process; numbered from 0.

    Where the disk takes no more (see `tempfile` for where that is), they stay in memory.
    """

    def __init__(self) -> None:
        self._file: IO[bytes] | None = None
        self._where: dict[int, tuple[int, int] | bytes] = {}
        self._end = self._used = self._next = 0
        self._dropped: deque[int] = deque()

    def __len__(self) -> int:
        """Number of blocks that are there."""
        return len(self._where)

    def append(self, block: bytes) -> int:
        """Add a block; return its number."""
        while self._dropped:
            self.discard(self._dropped.popleft())
        self._put(self._next, block)
        self._next += 1
        return self._next - 1

    def __getitem__(self, number: int) -> bytes:
        """Read a block. Raises KeyError for one that is not there."""
        where = self._where[number]
        if isinstance(where, bytes):
            return where
        assert self._file is not None
        self._file.seek(where[0])
        return self._file.read(where[1])

    def discard(self, number: int) -> None:
        """Drop a block; its room is used again once more than half of the file is free."""
        where = self._where.pop(number)
        if isinstance(where, bytes):
            return
        self._used -= where[1]
        if self._end > 2 * self._used + _LITTLE:
            self._rewrite()

    def drop(self, number: int) -> None:
        """Discard a block when the next one comes: may be called in the midst of anything."""
        self._dropped.append(number)

    def _put(self, number: int, block: bytes) -> None:
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(prefix="lineloom-")  # noqa: SIM115
            self._file.seek(self._end)
            self._file.write(block)
            self._file.flush()
        except OSError:
            self._where[number] = block
        else:
            self._where[number] = self._end, len(block)
            self._end += len(block)
            self._used += len(block)

    def _rewrite(self) -> None:
        """Copy what is there into a new file, one block after the other."""
        old, numbers = Spool(), list(self._where)
        old._file, old._where = self._file, self._where
        self._file, self._where, self._end, self._used = None, {}, 0, 0
        for number in numbers:
            self._put(number, old[number])


class Spooled:
    """A block of a spool, there for as long as somebody holds this."""

    def __init__(self, spool: Spool, block: bytes) -> None:
        self._spool = spool
        self._number = spool.append(block)

    def __del__(self) -> None:
        # The collector may come while the spool is being rewritten.
        self._spool.drop(self._number)

    def read(self) -> bytes:
        """Return the block."""
        return self._spool[self._number]
