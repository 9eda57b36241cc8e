"""Bags of ROS 1 that were not closed: read chunk by chunk, the last one as far as it goes."""

from __future__ import annotations

import bz2
import struct
from collections.abc import Iterator
from pathlib import Path

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

from lineloom_core.io.salvage import Channel, Salvaged, normal

_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
_MAGIC = b"#ROSBAG V2.0\n"


def salvage_rosbag1(path: Path) -> Salvaged:
    """Read what the chunks hold. Raises ValueError where it is no bag of version 2.0."""
    data = path.read_bytes()
    if not data.startswith(_MAGIC):
        raise ValueError("it does not begin as a bag of ROS 1 does")
    found, channels = Salvaged(), dict[int, Channel]()
    for header, body, whole in _records(data, len(_MAGIC)):
        missing = 0
        if header.get("op") == bytes([_CHUNK]):
            inner = _unpacked(header.get("compression", b"none"), body)
            for fields, content, complete in _records(inner, 0):
                if complete:
                    _take(found, channels, fields, content)
            missing = int.from_bytes(header.get("size", b""), "little") - len(inner)
        elif whole:
            _take(found, channels, header, body)
        if not whole:
            found.cut(len(data), max(0, missing))
    return found


def _take(
    found: Salvaged, channels: dict[int, Channel], header: dict[str, bytes], body: bytes
) -> None:
    kind = header.get("op", b"\0")[0]
    if kind not in (_MESSAGE, _CONNECTION) or len(header.get("conn", b"")) != 4:
        return
    (number,) = struct.unpack("<L", header["conn"])
    if kind == _CONNECTION:
        if number not in channels:
            about = _fields(body)
            msgtype = normal(about.get("type", b"").decode(errors="replace"))
            topic = header.get("topic", b"").decode(errors="replace")
            channels[number] = Channel(number, topic, msgtype, "ros1")
            found.connections.append(channels[number])
    elif number in channels and len(header.get("time", b"")) == 8:
        seconds, nanoseconds = struct.unpack("<LL", header["time"])
        found.read.append((channels[number], seconds * 10**9 + nanoseconds, body))


def _records(data: bytes, at: int) -> Iterator[tuple[dict[str, bytes], bytes, bool]]:
    """Yield header, body, and whether it is whole; the last one may not be."""
    while at + 4 <= len(data):
        (size,) = struct.unpack_from("<L", data, at)
        body_at = at + 4 + size
        if body_at + 4 > len(data):
            yield {}, b"", False
            return
        header = _fields(data[at + 4 : body_at])
        (length,) = struct.unpack_from("<L", data, body_at)
        at = body_at + 4 + length
        yield header, data[body_at + 4 : at], at <= len(data)


def _fields(data: bytes) -> dict[str, bytes]:
    fields, at = dict[str, bytes](), 0
    while at + 4 <= len(data):
        (size,) = struct.unpack_from("<L", data, at)
        name, _, value = data[at + 4 : at + 4 + size].partition(b"=")
        fields[name.decode(errors="replace")] = value
        at += 4 + size
    return fields


def _unpacked(compression: bytes, body: bytes) -> bytes:
    """Return what a chunk holds, of one that is cut what its beginning holds."""
    try:
        if compression == b"bz2":
            return bz2.BZ2Decompressor().decompress(body)
        if compression == b"lz4":
            unpacked: bytes = LZ4FrameDecompressor().decompress(body)
            return unpacked
    except (OSError, RuntimeError):
        return b""
    return body
