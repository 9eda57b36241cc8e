"""How much one token may ask at a time, and how often: the others' share stays theirs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from starlette.types import ASGIApp, Receive, Scope, Send

from lineloom_service.errors import TOO_MANY_REQUESTS, ProblemError

_HELD = "lineloom.quota"
"""Where a request's own hold on a quota is in its ASGI scope."""

_BURST_S = 2.0
"""Of unused rate so much is saved up."""


@dataclass(frozen=True, slots=True)
class Allowance:
    """requests: at a time, streams of events aside. streams: of events. rate: requests a second."""

    requests: int
    streams: int
    rate: float


@dataclass(slots=True)
class _Use:
    """What a token has under way, and how many requests it has saved up."""

    saved: float
    at: float
    requests: int = 0
    streams: int = 0


class Quotas:
    """Counts for every token that is used; a token that is not known is counted nowhere."""

    def __init__(self, allowance: Allowance) -> None:
        self._allowance = allowance
        self._uses: dict[str, _Use] = {}

    def take(self, token: str, *, stream: bool) -> Callable[[], None]:
        """Count a request of a token; return what ends it. Raises ProblemError (429)."""
        allowance, now = self._allowance, time.monotonic()
        most = allowance.rate * _BURST_S
        use = self._uses.setdefault(token, _Use(most, now))
        use.saved = min(most, use.saved + (now - use.at) * allowance.rate)
        use.at = now
        if use.saved < 1.0:
            raise _too_many(f"the token is good for {allowance.rate:g} requests a second")
        limit = allowance.streams if stream else allowance.requests
        if (use.streams if stream else use.requests) >= limit:
            what = "streams of events" if stream else "requests"
            raise _too_many(f"the token is good for {limit} {what} at a time")
        use.saved -= 1.0
        self._count(use, stream, 1)
        return lambda: self._count(use, stream, -1)

    @staticmethod
    def _count(use: _Use, stream: bool, by: int) -> None:
        if stream:
            use.streams += by
        else:
            use.requests += by


class QuotaEnd:
    """ASGI middleware: ends what a request holds of its token's quota when it is dealt with."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        held: list[Callable[[], None]] = []
        scope[_HELD] = held
        try:
            await self._app(scope, receive, send)
        finally:
            for end in held:
                end()


def hold(scope: Scope, end: Callable[[], None]) -> None:
    """Have `end` called when the request is dealt with."""
    scope[_HELD].append(end)


def _too_many(detail: str) -> ProblemError:
    return ProblemError(TOO_MANY_REQUESTS, f"{detail}; ask again", headers={"Retry-After": "1"})
