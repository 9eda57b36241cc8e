"""The asynchronous client."""

from __future__ import annotations

import asyncio
import itertools
import time
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from typing import TypeVar

import httpx
from typing_extensions import Self

from lineloom import calls
from lineloom.async_following import follow
from lineloom.async_queries import AsyncQueries
from lineloom.calls import Call, Encoding, Name
from lineloom.errors import ConnectionFailedError
from lineloom.retry import RetryPolicy
from lineloom.scan_like import ScanLike, batches
from lineloom.session import DEFAULT_BATCH, BatchTotal, Session, not_idle, not_ready
from lineloom.wire import (
    AnyEvent,
    IngestAnswer,
    Scan,
    Site,
)

_FIRST_POLL = 0.05
_SLOWEST_POLL = 1.0
_T = TypeVar("_T")


class AsyncClient(AsyncQueries):
    """Lineloom over HTTP, for asyncio.

    url: default LINELOOM_URL, else the embedded service on this machine. token: default
    LINELOOM_TOKEN. encoding: of scans. compress: gzip bodies; None = unless the service runs on
    this machine. transport: for tests. Raises LineloomError and nothing else on purpose: see
    `lineloom.errors` for the tree.
    """

    def __init__(
        self,
        url: str | None = None,
        *,
        token: str | None = None,
        encoding: Encoding = "msgpack",
        compress: bool | None = None,
        retry: RetryPolicy | None = None,
        timeout: float = 30.0,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self.session = Session.build(url, token, encoding, compress, retry, timeout)
        self._http = httpx.AsyncClient(transport=transport, **self.session.http_options())

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc_info: object) -> None:
        await self.aclose()

    async def aclose(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    # Ingest

    async def post_scan(self, site: Name, robot: Name, scan: ScanLike) -> IngestAnswer:
        """Send one scan; when this returns, the service has it on disk."""
        return await self.post_scans(site, robot, [scan])

    async def post_scans(
        self, site: Name, robot: Name, scans: Iterable[ScanLike], *, batch: int = DEFAULT_BATCH
    ) -> IngestAnswer:
        """Send scans of one robot in order, in batches, and return the sum of the answers.

        Refused scans are listed in `rejected`, with their place in the whole list. Sending again
        is harmless: the service knows a scan by session and seq.
        """
        total = BatchTotal()
        for part in batches(scans, batch):
            total.add(await self._post(site, robot, part), len(part))
        return total.answer

    def events(
        self, site: Name, *, last_event_id: str | None = None, until_now: bool = False
    ) -> AsyncIterator[AnyEvent]:
        """Yield what happens to a site from now on, or after the event `last_event_id`.

        Goes on by itself across lost connections and restarts of the service, missing nothing; a
        `reset` event says where that was not possible. Ends with what there is so far where
        `until_now`; else raises once the site is gone or the service stays away.
        """
        return follow(self._http, self.session, site, last_event_id, until_now)

    # Wait

    async def wait_until_ready(self, timeout: float = 60.0, *, maps: bool = False) -> None:
        """Wait until scans are taken, and mapped at once where `maps`, or raise NotIdleError."""
        deadline = time.monotonic() + timeout
        while True:
            try:
                state = await self.ready()
                reasons = state.reasons
                if state.maps if maps else state.takes_scans:
                    return
            except ConnectionFailedError as error:
                reasons = [error.reason]
            if time.monotonic() >= deadline:
                raise not_ready(self.session.url, timeout, reasons)
            await asyncio.sleep(4.0 * _FIRST_POLL)

    async def wait_until_idle(
        self,
        site: Name,
        timeout: float = 600.0,
        *,
        on_poll: Callable[[Site], object] | None = None,
    ) -> Site:
        """Wait until all that was accepted is in the map, loops and merges included.

        Returns the site at that moment; raises NotIdleError after `timeout` seconds. on_poll is
        given every answer on the way.
        """
        deadline = time.monotonic() + timeout
        pause = _FIRST_POLL
        while True:
            state = await self.site(site)
            if on_poll is not None:
                on_poll(state)
            if state.idle:
                return state
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise not_idle(state, timeout)
            await asyncio.sleep(min(pause, left))
            pause = min(1.5 * pause, _SLOWEST_POLL)

    async def _post(self, site: Name, robot: Name, part: Sequence[Scan]) -> IngestAnswer:
        call = calls.post_scans(
            site,
            robot,
            part,
            encoding=self.session.encoding,
            compress=self.session.compress,
        )
        return await self._send(call)

    async def _send(self, call: Call[_T]) -> _T:
        for attempt in itertools.count():
            try:
                response = await self._http.request(**self.session.request_options(call))
            except httpx.TransportError as error:
                await asyncio.sleep(self.session.after_failure(call, attempt, error))
                continue
            pause = self.session.after_answer(call, attempt, response)
            if pause is None:
                return call.read(response)
            await asyncio.sleep(pause)
        raise AssertionError("unreachable: attempts are counted without end")
