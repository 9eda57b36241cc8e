"""What a worker is working on, in memory that outlives it: whom to blame when it dies."""

from __future__ import annotations

import mmap
import os
import struct
import tempfile
import time

RESTORING = -1
"""Stands for a position while a snapshot is read."""

BUSY = -2
"""Stands for a position while the site is worked on, and no entry is to blame for it."""

_LAYOUT = struct.Struct("=qqd")
_BEATS = struct.Struct("=q")
_SIZE = _LAYOUT.size + _BEATS.size
_NOTHING = (0, 0)


class CurrentEntry:
    """Site id and position, shared by two processes through a file that has no name."""

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self._memory = mmap.mmap(fd, _SIZE)

    @classmethod
    def create(cls) -> CurrentEntry:
        """Make a new one; the file goes with the last process that has it open."""
        with tempfile.TemporaryFile() as file:
            file.truncate(_SIZE)
            fd = os.dup(file.fileno())
        try:
            return cls(fd)
        except BaseException:
            os.close(fd)
            raise

    def mark(self, site: int, position: int) -> None:
        """Say what is being worked on now."""
        _LAYOUT.pack_into(self._memory, 0, site, position, time.monotonic())

    def clear(self) -> None:
        """Say that nothing is."""
        _LAYOUT.pack_into(self._memory, 0, *_NOTHING, 0.0)

    def read(self) -> tuple[int, int] | None:
        """Return site and position, None where nothing is being worked on."""
        site, position, _ = _LAYOUT.unpack_from(self._memory, 0)
        return None if (site, position) == _NOTHING else (site, position)

    def seconds(self) -> float:
        """How long it has been worked on; 0 where nothing is. The clock is the whole machine's."""
        site, position, since = _LAYOUT.unpack_from(self._memory, 0)
        return 0.0 if (site, position) == _NOTHING else time.monotonic() - float(since)

    def beat(self) -> None:
        """Say that the process is alive, whatever it is working on."""
        _BEATS.pack_into(self._memory, _LAYOUT.size, self.beats() + 1)

    def beats(self) -> int:
        """Return how often it has said so."""
        beats: int = _BEATS.unpack_from(self._memory, _LAYOUT.size)[0]
        return beats

    def close(self) -> None:
        """Let go of the memory."""
        self._memory.close()
        os.close(self.fd)
