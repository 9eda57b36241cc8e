"""MCAP files without an end, and those whose messages are JSON: walked through record by record."""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator
from pathlib import Path

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

from lineloom_core.io.salvage import Channel, Salvaged, normal

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 2, 3, 4, 5, 6


def salvage_mcap(path: Path) -> Salvaged:
    """Read what the records hold. Raises ValueError where it is no MCAP file."""
    data = path.read_bytes()
    if not data.startswith(_MAGIC):
        raise ValueError("it does not begin as an MCAP file does")
    walk = _Walk()
    missing = 0
    for kind, body, whole in _records(data, len(_MAGIC)):
        if kind == _FOOTER:
            return walk.found
        if kind == _CHUNK:
            inner = _unpacked(body)
            for of_chunk, content, complete in _records(inner, 0):
                if complete:
                    walk.take(of_chunk, content)
            size = int.from_bytes(body[16:24], "little")
            missing += max(0, size - len(inner))
        elif whole:
            walk.take(kind, body)
    walk.found.cut(len(data), missing)
    return walk.found


class _Walk:
    def __init__(self) -> None:
        self.found = Salvaged()
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, Channel] = {}

    def take(self, kind: int, body: bytes) -> None:
        """Take a record, passing over what makes no sense."""
        try:
            if kind == _SCHEMA:
                (number,) = struct.unpack_from("<H", body)
                self._schemas[number] = _text(body, 2)[0]
            elif kind == _CHANNEL:
                self._channel(body)
            elif kind == _MESSAGE:
                number, _, time = struct.unpack_from("<HLQ", body)
                if number in self._channels:
                    self.found.read.append((self._channels[number], time, body[22:]))
        except struct.error:
            return

    def _channel(self, body: bytes) -> None:
        number, schema = struct.unpack_from("<HH", body)
        topic, at = _text(body, 4)
        encoding, _ = _text(body, at)
        if number not in self._channels:
            name = self._schemas.get(schema, "")
            msgtype = normal(name) if "/" in name else name
            channel = self._channels[number] = Channel(number, topic, msgtype, encoding)
            self.found.connections.append(channel)


def _records(data: bytes, at: int) -> Iterator[tuple[int, bytes, bool]]:
    """Yield kind, body, and whether it is whole; the last one may not be."""
    while at + 9 <= len(data):
        kind, length = struct.unpack_from("<BQ", data, at)
        body = data[at + 9 : at + 9 + length]
        at += 9 + length
        yield kind, body, len(body) == length


def _text(body: bytes, at: int) -> tuple[str, int]:
    (size,) = struct.unpack_from("<L", body, at)
    return body[at + 4 : at + 4 + size].decode(errors="replace"), at + 4 + size


def _unpacked(chunk: bytes) -> bytes:
    """Return the records of a chunk, of one that is cut those at its beginning."""
    if len(chunk) < 32:
        return b""
    compression, at = _text(chunk, 28)
    packed = chunk[at + 8 :]
    try:
        if compression == "zstd":
            plain: bytes = zstd.ZstdDecompressor().decompress(packed)
            return plain
        if compression == "lz4":
            unpacked: bytes = LZ4FrameDecompressor().decompress(packed)
            return unpacked
    except (zstd.ZstdError, RuntimeError):
        return b""
    return packed if not compression else b""
