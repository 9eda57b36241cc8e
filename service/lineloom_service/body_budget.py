"""So many bytes of request bodies at a time, all senders together: each may be large, not all."""

from __future__ import annotations

from dataclasses import dataclass

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from lineloom_service.errors import TOO_MUCH_AT_ONCE, ProblemError

LEASE = "lineloom.body_lease"
"""Where a request's lease is in its ASGI scope."""

_AGAIN_S = 1


@dataclass(slots=True)
class BodyBudget:
    """What all bodies may take, and what they take now [bytes]."""

    limit: int
    taken: int = 0

    def take(self, size: int) -> None:
        """Raises ProblemError (503) where there is not so much left."""
        if self.taken + size > self.limit:
            detail = "the service is reading as many bodies as it can hold; send it again"
            # The rest of the body is not read: the connection cannot be used again.
            headers = {"Retry-After": str(_AGAIN_S), "Connection": "close"}
            raise ProblemError(TOO_MUCH_AT_ONCE, detail, headers=headers)
        self.taken += size


class BodyLease:
    """One request's share: grows with what is read, ends with the request."""

    def __init__(self, budget: BodyBudget) -> None:
        self._budget = budget
        self._size = 0

    def take(self, size: int) -> None:
        """Take more. Raises ProblemError (503)."""
        self._budget.take(size)
        self._size += size

    def end(self) -> None:
        """Give all back."""
        self._budget.taken -= self._size
        self._size = 0


class BodyAdmission:
    """ASGI middleware: counts every body as it comes in, and no longer when it is dealt with."""

    def __init__(self, app: ASGIApp, budget: BodyBudget) -> None:
        self._app = app
        self._budget = budget

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, with a lease."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        lease = scope[LEASE] = BodyLease(self._budget)

        async def receive_counted() -> Message:
            message = await receive()
            lease.take(len(message.get("body", b"")))
            return message

        try:
            await self._app(scope, receive_counted, send)
        finally:
            lease.end()


def lease_of(scope: Scope) -> BodyLease:
    """Return a request's lease: for what its body becomes."""
    lease: BodyLease = scope[LEASE]
    return lease
