"""Decides whether a request may pass."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
import time
from collections.abc import Awaitable, Callable, Sequence

from lineloom_service.errors import FORBIDDEN, UNAUTHORIZED, ProblemError
from lineloom_service.security.token import Scope, TokenRecord, parse_token
from lineloom_service.store.records import StoreError

_LOG = logging.getLogger(__name__)
_REFRESH_S = 2.0
"""A token that was revoked is good for so long at most."""
_UNKNOWN_PAUSE_S = 0.2
"""A token that nobody knows makes the guard look again, but not more often than this."""


class UnprotectedError(Exception):
    """The service would be reachable from outside, and nothing protects it."""


class Guard:
    """Knows all tokens. Where there has never been one, everybody on this machine may pass.

    read: returns all tokens, also revoked ones: revoking the last token opens nothing.
    """

    def __init__(self, read: Callable[[], Awaitable[Sequence[TokenRecord]]]) -> None:
        self._read = read
        self._tokens: dict[str, TokenRecord] = {}
        self._read_at = -_UNKNOWN_PAUSE_S
        self._refreshing: asyncio.Task[None] | None = None

    @property
    def protects(self) -> bool:
        """Whether tokens are asked for."""
        return bool(self._tokens)

    async def start(self, host: str, *, open: bool) -> None:
        """Read the tokens. Raises UnprotectedError where `host` needs some and there are none."""
        await self._refresh()
        if not (self.protects or open or is_loopback(host)):
            raise UnprotectedError(
                f"{host} is reachable from outside and nothing protects the service: create a "
                "token (lineloom token create), listen on 127.0.0.1, or say that this is meant "
                "(--open, LINELOOM_OPEN=true)"
            )
        self._refreshing = asyncio.create_task(self._keep_fresh())

    async def stop(self) -> None:
        """Look for new tokens no longer."""
        if self._refreshing is not None:
            self._refreshing.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._refreshing

    async def admit(
        self,
        authorization: str | None,
        scope: Scope,
        site: str | None,
        robot: str | None,
        *,
        anywhere: bool = False,
    ) -> TokenRecord | None:
        """Return the token that allows this, None where none is needed.

        anywhere: what is asked is about no site, or tells of the token's own only.
        Raises ProblemError: 401 without a good token, 403 where it is not good for this.
        """
        if not self.protects:
            return None
        record = await self._identify(authorization)
        if scope not in record.scopes:
            have = ", ".join(record.scopes)
            raise _forbidden(f"this takes scope {scope!r}; the token has {have}", scope)
        for what, bound, wanted in (("site", record.site, site), ("robot", record.robot, robot)):
            if bound is not None and bound != wanted and not (anywhere and wanted is None):
                raise _forbidden(f"the token is for {what} {bound!r} only", scope)
        return record

    def still_good(self, token_id: str | None) -> bool:
        """Whether what was admitted may go on: for answers that take long."""
        if token_id is None:
            return not self.protects
        record = self._tokens.get(token_id)
        return record is not None and record.revoked is None

    async def _identify(self, authorization: str | None) -> TokenRecord:
        kind, _, text = (authorization or "").partition(" ")
        if kind.lower() != "bearer" or not text:
            raise _unauthorized("send a token: `Authorization: Bearer …`", None)
        parsed = parse_token(text.strip())
        if parsed is None:
            raise _unauthorized("this is not a token of Lineloom", "invalid_token")
        name, secret = parsed
        if name not in self._tokens and time.monotonic() - self._read_at > _UNKNOWN_PAUSE_S:
            await self._refresh()
        record = self._tokens.get(name)
        if record is None or not record.proves(secret) or record.revoked is not None:
            raise _unauthorized("the token is unknown, or was revoked", "invalid_token")
        return record

    async def _keep_fresh(self) -> None:
        while True:
            await asyncio.sleep(_REFRESH_S)
            try:
                await self._refresh()
            except StoreError:
                _LOG.warning("the tokens cannot be read; those known so far stay good")

    async def _refresh(self) -> None:
        self._read_at = time.monotonic()
        self._tokens = {record.id: record for record in await self._read()}


def is_loopback(host: str) -> bool:
    """Whether an address is reachable from this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _unauthorized(detail: str, error: str | None) -> ProblemError:
    challenge = 'Bearer realm="lineloom"' + ("" if error is None else f', error="{error}"')
    return ProblemError(UNAUTHORIZED, detail, headers={"WWW-Authenticate": challenge})


def _forbidden(detail: str, scope: Scope) -> ProblemError:
    challenge = f'Bearer realm="lineloom", error="insufficient_scope", scope="{scope}"'
    return ProblemError(FORBIDDEN, detail, headers={"WWW-Authenticate": challenge})
