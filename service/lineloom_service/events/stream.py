"""Server-Sent Events over HTTP, to readers of any speed."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncGenerator

from fastapi.sse import KEEPALIVE_COMMENT, EventSourceResponse, format_sse_event
from starlette.types import Send

from lineloom_service.events.feed import Message

_LOG = logging.getLogger(__name__)

_HEADERS = {
    "Cache-Control": "no-store",
    # Proxies (nginx) gather answers otherwise, and events come late or never.
    "X-Accel-Buffering": "no",
}


class EventStream(EventSourceResponse):
    """Sends a listener's messages. One that takes nothing for `patience_s` is dropped.

    What waits for a slow reader are the bytes of one message and the connection's own buffer.
    """

    def __init__(self, messages: AsyncGenerator[Message | None], patience_s: float) -> None:
        self._chunks = _written(messages)
        super().__init__(self._chunks, headers=_HEADERS)
        self._patience_s = patience_s

    async def stream_response(self, send: Send) -> None:
        """Send the start, then message by message."""
        await send(
            {"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers}
        )
        async with contextlib.aclosing(self._chunks) as chunks:
            async for chunk in chunks:
                body = {"type": "http.response.body", "body": chunk, "more_body": True}
                try:
                    async with asyncio.timeout(self._patience_s):
                        await send(body)
                except TimeoutError:
                    # Returning without an end makes the server close the connection.
                    _LOG.info("a listener that does not read was dropped")
                    return
        await send({"type": "http.response.body", "body": b"", "more_body": False})


async def _written(messages: AsyncGenerator[Message | None]) -> AsyncGenerator[bytes]:
    async with contextlib.aclosing(messages):
        async for message in messages:
            if message is None:
                yield KEEPALIVE_COMMENT
            elif message.event is None:
                # No event for the listener's program, but its next `Last-Event-ID`.
                yield format_sse_event(id=str(message.place))
            else:
                told = message.event
                yield format_sse_event(event=told.type, data_str=told.data, id=str(message.place))
