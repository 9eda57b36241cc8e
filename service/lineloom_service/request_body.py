"""Reads a request's body: within limits, decompressed, decoded to plain Python values."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import msgpack
from fastapi import Request
from lineloom.wire import JSON, MSGPACK
from pydantic_core import from_json

from lineloom_service.body_budget import lease_of
from lineloom_service.body_pace import take_paced
from lineloom_service.errors import (
    MALFORMED_BODY,
    TOO_LARGE,
    UNSUPPORTED_ENCODING,
    UNSUPPORTED_TYPE,
    ProblemError,
)
from lineloom_service.settings import Settings

_MOST_MEMBERS = 64
"""Each costs a copy of what follows it."""

_MOST_ITEMS = 100_000
"""In one msgpack array or map: a header alone makes the decoder set so much memory aside."""

_MOST_CONTAINERS = 100_000
_MOST_VALUES = 5_000_000
"""In a whole body. A thousand scans of two thousand beams have half of these; an empty list costs
one byte as msgpack, next to nothing with gzip, and 72 bytes of memory."""

_GZIP = 31  # zlib's window bits for "a gzip header and trailer, nothing else"


@dataclass(frozen=True, slots=True)
class Body:
    """A decoded body. is_json: it came as JSON, where NaN and Infinity are no values."""

    value: Any
    is_json: bool


async def read_body(request: Request, settings: Settings) -> Body:
    """Return the body of a request, within the limits of its size, also plain, and its pace.

    Raises ProblemError: 415 before anything is read, 413 as soon as it is known, 408, 400.
    """
    is_json = _is_json(request)
    data = await read_raw(request, settings)
    return Body(_decode_json(data) if is_json else _decode_msgpack(data), is_json)


async def read_raw(request: Request, settings: Settings) -> bytes:
    """Return a body of another kind as it is, but decompressed. Raises as `read_body` does."""
    limit = settings.max_body_bytes
    is_gzip = _is_gzip(request)
    data = await _read(request, settings)
    if is_gzip:
        data = _gunzip(data, limit)
        lease_of(request.scope).take(len(data))
    return data


def _is_json(request: Request) -> bool:
    content_type = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if content_type not in (JSON, MSGPACK):
        raise ProblemError(
            UNSUPPORTED_TYPE,
            f"Content-Type is {content_type or 'missing'}; send {JSON} or {MSGPACK}",
            headers={"Accept": f"{JSON}, {MSGPACK}"},
        )
    return content_type == JSON


def _is_gzip(request: Request) -> bool:
    encoding = request.headers.get("content-encoding", "identity").strip().lower()
    if encoding not in ("identity", "gzip", ""):
        raise ProblemError(
            UNSUPPORTED_ENCODING,
            f"Content-Encoding is {encoding}; send gzip or none",
            headers={"Accept-Encoding": "gzip"},
        )
    return encoding == "gzip"


async def _read(request: Request, settings: Settings) -> bytes:
    limit = settings.max_body_bytes
    declared = request.headers.get("content-length", "")
    if declared.isdigit() and int(declared) > limit:
        raise _too_large(limit)
    parts: list[bytes] = []
    size = 0

    def take(part: bytes) -> None:
        nonlocal size
        size += len(part)
        if size > limit:
            raise _too_large(limit)
        parts.append(part)

    await take_paced(request.stream(), settings.slow_sender_s, settings.min_body_rate, take)
    return b"".join(parts)


def _gunzip(data: bytes, limit: int) -> bytes:
    """Decompress. A bomb costs no more than a full body: neither one large member nor many."""
    plain = bytearray()
    rest = data
    for _ in range(_MOST_MEMBERS):
        stream = zlib.decompressobj(_GZIP)
        try:
            # One byte more than allowed tells a full body from one that is too large.
            plain += stream.decompress(rest, limit + 1 - len(plain))
        except zlib.error as error:
            raise ProblemError(MALFORMED_BODY, f"the body is not gzip: {error}") from error
        if len(plain) > limit:
            raise _too_large(limit)
        if not stream.eof:
            raise ProblemError(MALFORMED_BODY, "the gzip stream ends too early")
        rest = stream.unused_data
        if not rest:
            return bytes(plain)
    detail = f"a gzip stream may have {_MOST_MEMBERS} members; compress the body in one go"
    raise ProblemError(TOO_LARGE, detail)


def _decode_json(data: bytes) -> Any:
    # Signs within texts count as well: none that is meant has so many.
    containers = data.count(b"[") + data.count(b"{")
    _check_values(containers, containers + data.count(b",") + data.count(b":"))
    try:
        # NaN and Infinity pass here, to be refused later by the field that has them.
        return from_json(data, allow_inf_nan=True)
    except ValueError as error:
        raise ProblemError(MALFORMED_BODY, f"the body is not JSON: {error}") from error


def _decode_msgpack(data: bytes) -> Any:
    values = _Values()
    try:
        return msgpack.unpackb(
            data,
            max_array_len=_MOST_ITEMS,
            max_map_len=_MOST_ITEMS,
            list_hook=values.take_list,
            object_hook=values.take_map,
        )
    except ValueError as error:
        reason = str(error) or type(error).__name__
        raise ProblemError(MALFORMED_BODY, f"the body is not msgpack: {reason}") from error


class _Values:
    """Counts what is decoded, container by container."""

    def __init__(self) -> None:
        self._containers = self._values = 0

    def take_list(self, found: list[Any]) -> list[Any]:
        self._take(1 + len(found))
        return found

    def take_map(self, found: dict[Any, Any]) -> dict[Any, Any]:
        self._take(1 + 2 * len(found))
        return found

    def _take(self, values: int) -> None:
        self._containers += 1
        self._values += values
        _check_values(self._containers, self._values)


def _check_values(containers: int, values: int) -> None:
    if containers > _MOST_CONTAINERS or values > _MOST_VALUES:
        detail = (
            f"a body may hold {_MOST_VALUES} values in {_MOST_CONTAINERS} lists and objects; send "
            "fewer scans at a time"
        )
        raise ProblemError(TOO_LARGE, detail)


def _too_large(limit: int) -> ProblemError:
    # The rest of the body is not read: the connection cannot be used again.
    return ProblemError(
        TOO_LARGE,
        f"a body may have {limit} bytes, also after decompression; send fewer scans at a time",
        headers={"Connection": "close"},
    )
