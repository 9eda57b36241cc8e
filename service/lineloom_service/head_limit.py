"""How long a connection may be open without a request: uvicorn itself waits for a head for ever."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn import Config

from lineloom_service.head_size import BoundedHeads

_CONNECTION = "lineloom.connection"
"""Where a request's connection is in the `state` of its ASGI scope."""


class HeadLimit(asyncio.Protocol):
    """One connection: uvicorn's own protocol, closed when no complete head comes within a time.

    The time runs from the connection's beginning and from the end of each answer. Uvicorn closes a
    connection on which nothing at all comes after an answer sooner, by its keep-alive limit.
    """

    def __init__(self, inner: Callable[..., asyncio.Protocol], patience_s: float) -> None:
        """inner: makes uvicorn's protocol, given what goes into the state of every scope."""
        self._inner = inner(state={_CONNECTION: self})
        self._patience_s = patience_s
        self._loop = asyncio.get_running_loop()
        self._under_way = 0
        self._waits_since = self._loop.time()
        self._look: asyncio.TimerHandle | None = None
        self._transport: asyncio.BaseTransport | None = None

    @contextmanager
    def request(self) -> Iterator[None]:
        """Stop the clock while a request is under way."""
        self._under_way += 1
        try:
            yield
        finally:
            self._under_way -= 1
            self._waits_since = self._loop.time()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Start the clock."""
        self._transport = transport
        self._inner.connection_made(transport)
        self._waits_since = self._loop.time()
        self._look = self._loop.call_later(self._patience_s, self._close_if_late)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop it for good."""
        if self._look is not None:
            self._look.cancel()
        self._inner.connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Pass it on."""
        self._inner.data_received(data)

    def eof_received(self) -> bool | None:
        """Pass it on."""
        return self._inner.eof_received()

    def pause_writing(self) -> None:
        """Pass it on."""
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        """Pass it on."""
        self._inner.resume_writing()

    def _close_if_late(self) -> None:
        """Close, or look again when it may be time: a timer for every request would cost more."""
        assert self._transport is not None
        left = self._waits_since + self._patience_s - self._loop.time()
        if self._under_way:
            left = self._patience_s
        elif left <= 0.0:
            self._transport.close()
            return
        self._look = self._loop.call_later(left, self._close_if_late)


class HeadLimitApp:
    """ASGI middleware, the outermost: tells connections when their requests begin and end."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        connection: HeadLimit = scope["state"].pop(_CONNECTION)
        with connection.request():
            await self._app(scope, receive, send)


def head_limited(patience_s: float) -> type[asyncio.Protocol]:
    """Return the class to give to uvicorn's `Config` as `http`, around a `HeadLimitApp`."""

    class Limited(HeadLimit):
        def __init__(self, config: Config, app_state: dict[str, Any], **more: Any) -> None:
            def inner(state: dict[str, Any]) -> asyncio.Protocol:
                arguments = {"config": config, "app_state": {**app_state, **state}, **more}
                return BoundedHeads(**arguments)

            super().__init__(inner, patience_s)

    return Limited
