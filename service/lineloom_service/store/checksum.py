"""Checksums of log entries: whether one is what was accepted."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any

COLUMNS = ("site_id", "robot_id", "kind", "stream_id", "seq", "body")
"""What is covered: all that an entry says, and of whom, but not its place in the feed.

Nor whether a scan came late, which is said as it gets that place.
"""


def checksum_of(entry: Mapping[Any, Any]) -> int:
    """Return the CRC-32 of an entry, a row of the table or what is to be one."""
    body: bytes | None = entry["body"]
    kind = entry["kind"] if entry["stream_id"] is None else "scan"
    about = " ".join(str(entry[name]) for name in COLUMNS[:-1] if name != "kind")
    return zlib.crc32(body or b"", zlib.crc32(f"{kind} {about} {body is None} ".encode()))


def is_whole(entry: Mapping[Any, Any]) -> bool:
    """Whether a row is as it was written, as far as can be told: the oldest have no checksum."""
    return entry["crc"] is None or checksum_of(entry) == entry["crc"]
