"""Robots take turns, so that whoever asks something does not wait for all of them.

What is ready at the same time runs in one go of the event loop. With dozens of robots sending as
fast as they can that is dozens of bodies to decode, and a question that comes in between waits for
every one. So robots' requests are let in a few at a time, and after a shared commit their answers
go out a few at a time; nothing waits while the loop has nothing else to do.
"""

from __future__ import annotations

import asyncio
from collections import deque

from starlette.types import ASGIApp, Receive, Scope, Send

_AT_A_TIME = 2


class Pacer:
    """Hands out turns in the order asked for, a few in every go of the event loop."""

    def __init__(self) -> None:
        self._waiting: deque[asyncio.Future[None]] = deque()
        self._given = 0
        self._pumping = False

    async def turn(self) -> None:
        """Wait for a turn: for nothing where few want one."""
        loop = asyncio.get_running_loop()
        if not self._pumping:
            self._pumping = True
            loop.call_soon(self._pump)
        if self._given < _AT_A_TIME and not self._waiting:
            self._given += 1
            return
        mine: asyncio.Future[None] = loop.create_future()
        self._waiting.append(mine)
        await mine

    def _pump(self) -> None:
        """Give the next turns; comes again in the next go for as long as somebody waits."""
        self._given = 0
        while self._waiting and self._given < _AT_A_TIME:
            mine = self._waiting.popleft()
            if not mine.done():
                mine.set_result(None)
                self._given += 1
        self._pumping = self._given > 0
        if self._pumping:
            asyncio.get_running_loop().call_soon(self._pump)


class IngestPacing:
    """ASGI middleware: requests that bring scans wait for their turn."""

    def __init__(self, app: ASGIApp, pacer: Pacer) -> None:
        self._app = app
        self._pacer = pacer

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on when it is its turn."""
        if scope["type"] == "http" and scope["method"] == "POST":
            brings_scans: bool = scope["path"].endswith("/scans")
            if brings_scans:
                await self._pacer.turn()
        await self._app(scope, receive, send)
