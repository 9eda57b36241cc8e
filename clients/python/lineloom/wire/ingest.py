"""Sending scans, and what became of them."""

from __future__ import annotations

from pydantic import Field

from lineloom.wire.base import MAX_BATCH, Answer, Request
from lineloom.wire.scan import Scan


class ScanBatch(Request):
    """Several scans of one robot in one POST."""

    scans: list[Scan] = Field(min_length=1, max_length=MAX_BATCH)


class RejectedScan(Answer):
    """A scan of a batch that was refused: its place in the batch and why."""

    index: int
    seq: int | None = None
    reason: str


class IngestAnswer(Answer):
    """What 202 says: everything accepted is on disk.

    duplicates: scans that were there before (same session and seq); sending again is harmless.
    pending: scans of the site accepted and not yet in the map.
    """

    accepted: int
    duplicates: int
    rejected: list[RejectedScan]
    pending: int
