"""Sending scans, and what became of them."""

from __future__ import annotations

from pydantic import Field

from lineloom.wire.base import MAX_BATCH, Answer, Request
from lineloom.wire.scan import Scan


class ScanBatch(Request):
    """Several scans of one robot in one POST."""

    scans: list[Scan] = Field(min_length=1, max_length=MAX_BATCH)


class RejectedScan(Answer):
    """A scan that was refused: its place in the request and why.

    reason: `conflict` where its session has another scan of this seq; else which field is wrong,
    and how. pointer: JSON pointer to it. detail: in words, what to do.
    """

    index: int
    seq: int | None = None
    reason: str
    pointer: str = ""
    detail: str = ""


class IngestAnswer(Answer):
    """What 202 says: everything accepted is on disk.

    duplicates: scans that were there before (same session, seq and content); sending again is
    harmless. Without seq those are meant that were there with the same content.
    pending: scans of the site accepted and not yet in the map. suggested_rate_hz: scans a second
    that the robot may send while the site is overloaded, None where it is not. Leave scans out at
    equal intervals: one in three still makes a map.
    """

    accepted: int
    duplicates: int
    rejected: list[RejectedScan]
    pending: int
    suggested_rate_hz: float | None = None
