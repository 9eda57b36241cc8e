"""Something that an operator should know about a robot's sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lineloom_core.codec import storable

Severity = Literal["error", "warning", "note"]
"""error: the geometry is certainly wrong, nothing may be joined with it. warning: the map suffers.
note: good to know."""


@storable("finding")
@dataclass(frozen=True, slots=True)
class Finding:
    """name: stable, for scripts. message: plain words with the figures and what to do."""

    name: str
    severity: Severity
    message: str

    def __str__(self) -> str:
        return f"{self.name}: {self.message}"
