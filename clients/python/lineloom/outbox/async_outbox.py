"""The outbox for asyncio: the loop never waits for the disk or the network."""

from __future__ import annotations

import asyncio
from pathlib import Path

from typing_extensions import Self

from lineloom.async_client import AsyncClient
from lineloom.client import Client
from lineloom.outbox.outbox import DeliveryFailure, Outbox
from lineloom.outbox.queue import OnFull, OutboxStats, Refusal
from lineloom.retry import RetryPolicy
from lineloom.scan_like import ScanLike
from lineloom.session import DEFAULT_BATCH


class AsyncOutbox:
    """An `Outbox` whose calls are awaited; what it promises is said there.

    Delivery goes on in a thread of its own, over connections of its own to the service that
    `client` talks to. Scans put by one task keep their order; so do the files, whichever of the two
    outboxes writes them.
    """

    def __init__(
        self,
        path: str | Path,
        client: AsyncClient,
        site: str,
        robot: str,
        *,
        session: str | None = None,
        max_scans: int = 100_000,
        on_full: OnFull = "drop-oldest",
        batch: int = DEFAULT_BATCH,
        sync: bool = True,
        retry: RetryPolicy | None = None,
    ) -> None:
        known = client.session
        self._client = Client(
            known.url,
            token=known.token,
            encoding=known.encoding,
            compress=known.compress,
            retry=known.retry,
            timeout=known.timeout,
        )
        self._outbox = Outbox(
            path,
            self._client,
            site,
            robot,
            session=session,
            max_scans=max_scans,
            on_full=on_full,
            batch=batch,
            sync=sync,
            retry=retry,
        )

    async def __aenter__(self) -> Self:
        self._outbox.start()
        return self

    async def __aexit__(self, *exc_info: object) -> None:
        await self.aclose()

    @property
    def session(self) -> str:
        """The session of scans that name none."""
        return self._outbox.session

    @property
    def failure(self) -> DeliveryFailure | None:
        """Why scans are waiting, or None where the latest attempt got through."""
        return self._outbox.failure

    async def put(self, scan: ScanLike) -> int:
        """Write a scan to disk and return its seq; see `Outbox.put`."""
        return await asyncio.to_thread(self._outbox.put, scan)

    async def flush(self, timeout: float = 60.0) -> OutboxStats:
        """Deliver everything; see `Outbox.flush`."""
        return await asyncio.to_thread(self._outbox.flush, timeout)

    async def stats(self) -> OutboxStats:
        """Return the counts since the file was made."""
        return await asyncio.to_thread(self._outbox.stats)

    async def refusals(self) -> list[Refusal]:
        """Return the latest scans that the service will never take, and why."""
        return await asyncio.to_thread(self._outbox.refusals)

    async def aclose(self, timeout: float = 5.0) -> None:
        """Stop; wait up to `timeout` seconds for a delivery under way. The rest stays on disk."""
        await asyncio.to_thread(self._outbox.close, timeout)
        self._client.close()
