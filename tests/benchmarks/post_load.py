"""Posts ready-made bodies over some connections as fast as they are acknowledged.

Plain sockets and a glance at the answers: a client library would cost more than the server.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from time import perf_counter
from typing import cast

_HEAD_END = b"\r\n\r\n"
_LENGTH = b"content-length: "


@dataclass(frozen=True, slots=True)
class Load:
    """What a run took. refused: answers other than 202, of which there should be none."""

    seconds: float
    posts: int
    refused: int


class _Connection(asyncio.Protocol):
    """Sends a request, waits for its answer, sends the next."""

    def __init__(self, requests: deque[bytes], done: asyncio.Future[None]) -> None:
        self._requests = requests
        self._done = done
        self._buffer = b""
        self._transport: asyncio.Transport | None = None
        self.posts = self.refused = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        # uvloop's is no subclass of asyncio's.
        self._transport = cast(asyncio.Transport, transport)
        self._next()

    def data_received(self, data: bytes) -> None:
        self._buffer += data
        end = self._buffer.find(_HEAD_END)
        if end < 0:
            return
        head = self._buffer[:end].lower()
        at = head.index(_LENGTH) + len(_LENGTH)
        length = int(head[at : at + 10].split(b"\r")[0])
        if len(self._buffer) < end + len(_HEAD_END) + length:
            return
        self._buffer = b""
        self.posts += 1
        self.refused += not head.startswith(b"http/1.1 202")
        self._next()

    def connection_lost(self, error: Exception | None) -> None:
        if not self._done.done():
            self._done.set_exception(error or ConnectionError("the server hung up"))

    def _next(self) -> None:
        assert self._transport is not None
        if self._requests:
            self._transport.write(self._requests.popleft())
        elif not self._done.done():
            self._done.set_result(None)
            self._transport.close()


async def post_all(host: str, port: int, requests: Iterable[bytes], connections: int) -> Load:
    """Send all requests, each over whichever connection is free next."""
    loop = asyncio.get_running_loop()
    waiting = deque(requests)
    endings = [loop.create_future() for _ in range(connections)]
    begin = perf_counter()
    opened = [
        await loop.create_connection(lambda end=end: _Connection(waiting, end), host, port)  # type: ignore[misc]
        for end in endings
    ]
    await asyncio.gather(*endings)
    seconds = perf_counter() - begin
    protocols = [protocol for _, protocol in opened]
    return Load(seconds, sum(p.posts for p in protocols), sum(p.refused for p in protocols))


def request(path: str, content_type: str, body: bytes) -> bytes:
    """Return a POST as it goes over the wire."""
    head = (
        f"POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {content_type}\r\n"
        f"Content-Length: {len(body)}\r\n\r\n"
    )
    return head.encode() + body
