"""Turns what every site publishes into its history of events, on disk before anyone is told.

The map is a function of the log, so a view is the same again whenever the log is mapped up to the
same entry. After a restart the site is mapped up to the entry that the last events were of; that
view is where the next events start from, and the history goes on as if nothing had happened.
"""

from __future__ import annotations

import asyncio
import logging
import time
from dataclasses import dataclass

from lineloom import wire
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.events.codec import Told, encode, pack
from lineloom_service.events.difference import events_between
from lineloom_service.events.hub import EventHub
from lineloom_service.store.actions import append_events
from lineloom_service.store.protocol import Store
from lineloom_service.store.reads import read_last_events
from lineloom_service.store.records import EventBatch, StoreError

_LOG = logging.getLogger(__name__)
_RETRY_S = 1.0
_SETTLE_S = 5.0


@dataclass(frozen=True, slots=True)
class _Publication:
    """A view that is to be told about. reset: why listeners must load anew instead."""

    position: int
    view: SiteView
    at: float
    reset: str | None = None


@dataclass(slots=True)
class _History:
    """A site's history as far as it goes. told: the view up to which everything is told."""

    number: int
    position: int
    version: int
    producer: str
    told: SiteView | None = None
    waiting: _Publication | None = None
    task: asyncio.Task[None] | None = None


class EventRecorder:
    """Keeps the history of every site that this service maps. kept: batches a site."""

    def __init__(self, store: Store, hub: EventHub, producer: str, kept: int) -> None:
        self._store = store
        self._hub = hub
        self._producer = producer
        self._kept = kept
        self._histories: dict[int, _History] = {}

    async def recorded_position(self, site_id: int) -> int:
        """Return the log position that a site's events go up to. Asked before it is mapped."""
        history = self._histories.get(site_id)
        if history is None:
            last = await self._store.read(read_last_events, site_id)
            history = (
                _History(0, 0, 0, self._producer)
                if last is None
                else _History(last.number, last.position, last.version, last.producer)
            )
            self._histories[site_id] = history
        return history.position

    def on_view(self, site_id: int, position: int, view: SiteView) -> None:
        """Take a published view. Where views come faster than they are told, some are skipped."""
        history = self._histories.get(site_id)
        if history is None or (history.told is None and position < history.position):
            return
        publication = _Publication(position, view, time.time())
        if history.told is None:
            reset = _why_reset(history, position, view, self._producer)
            history.told = view
            if reset is None:
                return
            publication = _Publication(position, view, time.time(), reset)
        elif history.waiting is not None and history.waiting.reset is not None:
            publication = _Publication(position, view, time.time(), history.waiting.reset)
        history.waiting = publication
        if history.task is None or history.task.done():
            history.task = asyncio.create_task(self._record(site_id, history))

    async def settled(self, site_id: int) -> None:
        """Wait until what was published is on disk, or until that takes too long."""
        history = self._histories.get(site_id)
        if history is not None and history.task is not None:
            await asyncio.wait({history.task}, timeout=_SETTLE_S)

    def forget_site(self, site_id: int) -> None:
        """A site was deleted."""
        history = self._histories.pop(site_id, None)
        if history is not None and history.task is not None:
            history.task.cancel()
        self._hub.close_site(site_id)

    def release(self) -> None:
        """Another process goes on from here: what is not on disk yet is its to tell."""
        for history in self._histories.values():
            if history.task is not None:
                history.task.cancel()
        self._histories.clear()

    async def stop(self) -> None:
        """Write what is waiting, and let the listeners go."""
        await asyncio.gather(*(self.settled(site_id) for site_id in self._histories))
        self._hub.stop()

    async def _record(self, site_id: int, history: _History) -> None:
        while (publication := history.waiting) is not None and history.told is not None:
            history.waiting = None
            told, body = await asyncio.to_thread(_tell, history.told, publication)
            batch = EventBatch(
                history.number + 1,
                publication.position,
                publication.view.version,
                self._producer,
                body,
            )
            try:
                if told:
                    await self._store.write_as_engine(append_events, site_id, batch, self._kept)
            except StoreError:
                _LOG.exception("events are not kept, trying again")
                history.waiting = history.waiting or publication
                await asyncio.sleep(_RETRY_S)
                continue
            history.told = publication.view
            if told:
                history.number, history.position = batch.number, batch.position
                history.version, history.producer = batch.version, batch.producer
                self._hub.add(site_id, batch.number, told)


def _why_reset(history: _History, position: int, view: SiteView, producer: str) -> str | None:
    """Tell why the history cannot go on from this view, None where it can."""
    if history.producer != producer:
        return "another version of the service has made the map anew"
    if position != history.position or view.version != history.version:
        return "the map was made anew, and not all that happened meanwhile was recorded"
    return None


def _tell(before: SiteView, publication: _Publication) -> tuple[tuple[Told, ...], bytes]:
    events: list[wire.AnyEvent]
    if publication.reset is not None:
        version, at = publication.view.version, publication.at
        events = [wire.ResetEvent(version=version, at=at, reason=publication.reset)]
    else:
        events = events_between(before, publication.view, publication.at)
    told = encode(events)
    return told, pack(told)
