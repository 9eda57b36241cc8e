"""A scan that has no pose."""

from __future__ import annotations

from dataclasses import dataclass

from lineloom_core.codec import storable


@storable("unplaced-scan")
@dataclass(frozen=True, slots=True)
class UnplacedScan:
    """A processed scan that fitted nowhere; after: number of placed ones processed before it."""

    session: str
    seq: int
    stamp: float
    after: int
