"""Whether a process still does anything: its own heartbeat, else the CPU time that it uses.

A heartbeat alone would not do. It comes from a thread that waits while a solver holds the
interpreter, for as long as that takes; but then CPU time passes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

LOOK_S = 1.0
"""How often whoever started a process looks."""

SILENT_LOOKS = 6
"""It is counted in looks, not in seconds: none pass while the whole machine is suspended."""

_SILENT_LOOKS_WITHOUT_CPU_TIME = 60
"""Where the system does not tell of CPU time, a long computation looks like silence."""

_STOPPED = "T"
_WAITS_FOR_DISK = "D"


class SignsOfLife:
    """Those of one process, looked for every `LOOK_S`. beats: returns its heartbeats so far."""

    def __init__(self, pid: int, beats: Callable[[], int]) -> None:
        self._stat = Path(f"/proc/{pid}/stat")
        self._beats = beats
        self._seen: tuple[int, int] | None = None
        self.silent_looks = 0
        self.stopped = False
        """Whether a signal has stopped it: somebody else's doing."""
        self._most = SILENT_LOOKS

    def look(self) -> None:
        """Look once more."""
        state, cpu = self._read_stat()
        self._most = SILENT_LOOKS if state else _SILENT_LOOKS_WITHOUT_CPU_TIME
        self.stopped = state == _STOPPED
        seen = self._beats(), cpu
        if seen != self._seen or state == _WAITS_FOR_DISK:
            self._seen, self.silent_looks = seen, 0
        else:
            self.silent_looks += 1

    @property
    def gone(self) -> bool:
        """Whether it has been silent for too long."""
        return self.silent_looks >= self._most

    def _read_stat(self) -> tuple[str, int]:
        """Return its state and the CPU time of all its threads, in ticks; nothing without /proc."""
        try:
            fields = self._stat.read_text().rpartition(")")[2].split()
            return fields[0], int(fields[11]) + int(fields[12])
        except (OSError, IndexError, ValueError):
            return "", 0
