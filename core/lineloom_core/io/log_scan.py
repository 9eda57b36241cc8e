"""What every reader of a recording yields, and how it says that it cannot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lineloom_core.scan import Scan


class LogError(ValueError):
    """A line that cannot be read; the message begins with file:line."""

    def __init__(self, path: Path, line: int, reason: str) -> None:
        super().__init__(f"{path}:{line}: {reason}")
        self.path = path
        self.line = line
        self.reason = reason


@dataclass(frozen=True, slots=True)
class LogScan:
    """A scan and the line that it is on, from 1."""

    scan: Scan
    line: int
