"""When scans that came late are given their places: in one batch, once no more of them come.

Each batch makes the map anew from where the first of them belongs, so an hour that is back-filled
shall cost one pass, and the next one begins when the pass before is shown.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable

from lineloom_service.store.back_fill import place_late
from lineloom_service.store.protocol import Store
from lineloom_service.store.records import SiteRecord, StoreError

_LOG = logging.getLogger(__name__)

_LONGEST = 20
"""Pauses after which they are placed although more come."""

_REST = 3
"""Where more come all the time, mapping takes this many times as long as making anew."""

_LOOK_AGAIN_S = 0.1


class BackFill:
    """The late scans of one site. pause_s: without more of them. busy: a map is being made anew."""

    def __init__(
        self, store: Store, record: SiteRecord, pause_s: float, busy: Callable[[], bool]
    ) -> None:
        self._store = store
        self._site = record.id
        self._pause_s = pause_s
        self._busy = busy
        self._late = 0
        self._task: asyncio.Task[None] | None = None

    def on_commit(self, record: SiteRecord) -> None:
        """There may be more of them."""
        self._late = record.late
        if self._late and (self._task is None or self._task.done()):
            self._task = asyncio.create_task(self._place(), name=f"back-fill-{record.name}")

    async def end(self) -> None:
        """Wait for nothing any more: what is late stays so, on the disk."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _place(self) -> None:
        while self._late:
            await self._until_no_more_come()
            began = time.monotonic()
            try:
                await self._store.write_as_engine(place_late, self._site)
            except StoreError:
                _LOG.exception("site %d: its late scans have no places yet", self._site)
            while self._busy():
                await asyncio.sleep(min(self._pause_s, _LOOK_AGAIN_S))
            if self._late:
                await asyncio.sleep(_REST * (time.monotonic() - began))

    async def _until_no_more_come(self) -> None:
        for _ in range(_LONGEST):
            before = self._late
            await asyncio.sleep(self._pause_s)
            if self._late == before and not self._busy():
                return
