"""Which scans of a request are new, which were there before, and which only say so.

`session` and `seq` name a scan. The same name with the same content is the same scan sent again;
with other content it is another scan, which is not taken and told. A scan without seq is known by
its content, and numbered here.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lineloom_service.store.codec import CorruptEntryError, decode_scan
from lineloom_service.store.records import Conflict, NewScan
from lineloom_service.store.sequencer import Stream
from lineloom_service.store.transaction import Transaction

_REMEMBERED = 2_000
"""Scans without seq that are known again when they are sent once more: two full requests."""

_CLOSE = 1e-6
"""Relative: what a number loses as JSON or as float32 makes no other scan."""


@dataclass(slots=True)
class Sorted:
    """What is new of one session, in the order of seq; what is not."""

    new: list[NewScan] = field(default_factory=list)
    duplicates: int = 0
    conflicts: list[Conflict] = field(default_factory=list)


def sort_out(tx: Transaction, stream: Stream, scans: Sequence[NewScan]) -> Sorted:
    """Tell what is new of one session's scans of a request. Changes nothing in the database."""
    found = Sorted()
    named = [scan for scan in scans if scan.seq is not None]
    here = tx.known(stream, [scan.seq for scan in named if scan.seq is not None])
    for scan in named:
        assert scan.seq is not None
        body = here.get(scan.seq)
        if body is None:
            here[scan.seq] = scan.body
            found.new.append(scan)
        elif _is_same(body, scan.body):
            found.duplicates += 1
        else:
            stamp = _stamp(body)
            conflict = Conflict(scan.index, scan.session, scan.seq, scan.stamp, stamp)
            found.conflicts.append(conflict)
    unnamed = [scan for scan in scans if scan.seq is None]
    if unnamed:
        highest = max([stream.highest, *here])
        _number(tx, stream, unnamed, highest, found)
    found.new.sort(key=lambda scan: scan.seq or 0)
    return found


def _number(
    tx: Transaction, stream: Stream, scans: Sequence[NewScan], highest: int, found: Sorted
) -> None:
    """Give numbers beyond `highest`, by stamp and then by arrival."""
    if stream.contents is None:
        latest = tx.latest(stream, _REMEMBERED)
        stream.contents = {_digest(body): seq for seq, body in latest}
    for scan in sorted(scans, key=lambda scan: (scan.stamp, scan.index)):
        digest = _digest(scan.body)
        if digest in stream.contents:
            found.duplicates += 1
            continue
        highest += 1
        stream.contents[digest] = highest
        found.new.append(replace(scan, seq=highest))
    while len(stream.contents) > _REMEMBERED:
        del stream.contents[next(iter(stream.contents))]


def _digest(body: bytes) -> bytes:
    return hashlib.blake2b(body, digest_size=16).digest()


def _is_same(body: bytes, other: bytes) -> bool:
    """Whether two scans hold the same, also where one was sent as float32 and one in decimals."""
    if body == other:
        return True
    try:
        a, b = decode_scan(body, "", 0), decode_scan(other, "", 0)
    except CorruptEntryError:
        return False
    if len(a.ranges) != len(b.ranges) or (a.odometry is None) != (b.odometry is None):
        return False
    figures = [
        (s.angle_min, s.angle_increment, s.range_min, s.range_max, s.time_increment, s.scan_time)
        + ((s.odometry.x, s.odometry.y, s.odometry.theta) if s.odometry is not None else ())
        for s in (a, b)
    ]
    return (
        math.isclose(a.stamp, b.stamp, rel_tol=1e-15, abs_tol=_CLOSE)
        and np.allclose(figures[0], figures[1], rtol=_CLOSE, atol=1e-9)
        and np.allclose(a.ranges, b.ranges, rtol=_CLOSE, atol=1e-9, equal_nan=True)
    )


def _stamp(body: bytes) -> float:
    try:
        return decode_scan(body, "", 0).stamp
    except CorruptEntryError:
        return math.nan
