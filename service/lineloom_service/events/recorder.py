"""Turns what every site publishes into its history of events, on disk before anyone is told.

The map is a function of the log, so a view is the same again whenever the log is mapped up to the
same entry. After a restart the site is mapped up to the entry that the last events were of; that
view is where the next events start from, and the history goes on as if nothing had happened.
"""

from __future__ import annotations

import asyncio
import logging
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

from lineloom import wire
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.engine.protocol import Remade
from lineloom_service.events.codec import encode, pack, tells_settled
from lineloom_service.events.difference import events_between
from lineloom_service.events.hub import EventHub
from lineloom_service.events.remade import as_file, remade_event
from lineloom_service.events.silence import silence_events
from lineloom_service.store.actions import append_events
from lineloom_service.store.files import put_file
from lineloom_service.store.protocol import Store
from lineloom_service.store.reads import read_last_events, read_last_number
from lineloom_service.store.records import DamagedError, EventBatch, StoreError

_LOG = logging.getLogger(__name__)
_RETRY_S = 1.0
_SETTLE_S = 5.0


@dataclass(frozen=True, slots=True)
class _Publication:
    """A view that is to be told about. making: what it was made with.

    reset: why listeners must load anew instead. remade: why the map is another one.
    """

    position: int
    view: SiteView
    making: str
    at: float
    reset: str | None = None
    remade: str | None = None


@dataclass(slots=True)
class _History:
    """A site's history as far as it goes. told: the view up to which everything is told."""

    number: int
    position: int
    version: int
    producer: str
    settled: bool = False
    told: SiteView | None = None
    waiting: _Publication | None = None
    task: asyncio.Task[None] | None = None


class EventRecorder:
    """Keeps the history of every site that this service maps. kept: batches a site."""

    def __init__(self, store: Store, hub: EventHub, kept: int) -> None:
        self._store = store
        self._hub = hub
        self._kept = kept
        self._histories: dict[int, _History] = {}

    async def told_of(self, site_id: int) -> str | None:
        """Return what the map was made with that was told of last, None where nothing was told."""
        history = await self._history(site_id)
        return history.producer or None

    async def recorded_position(self, site_id: int) -> int:
        """Return the log position that a site's events go up to. Asked before it is mapped."""
        return (await self._history(site_id)).position

    async def recorded_settled(self, site_id: int) -> bool:
        """Return whether the view there was settled: only that one is what was told."""
        return (await self._history(site_id)).settled

    async def _history(self, site_id: int) -> _History:
        history = self._histories.get(site_id)
        if history is None:
            history = self._histories[site_id] = await self._stored(site_id)
        return history

    async def _stored(self, site_id: int) -> _History:
        """Return the history as far as it is on disk; what is damaged ends it."""
        try:
            last = await self._store.read(read_last_events, site_id)
            if last is None:
                return _History(0, 0, 0, "")
            settled = tells_settled(last.body)
        except (DamagedError, ValueError, zlib.error):
            _LOG.exception("site %d: its last events cannot be read", site_id)
            number = await self._store.read(read_last_number, site_id)
            return _History(number, 0, 0, "")
        return _History(last.number, last.position, last.version, last.producer, settled)

    def on_view(self, site_id: int, position: int, view: SiteView, making: str) -> None:
        """Take a published view. Where views come faster than they are told, some are skipped."""
        history = self._histories.get(site_id)
        if history is None:
            return
        recorded = history.position, history.settled
        if history.told is None and (position, view.settled) < recorded:
            return
        publication = _Publication(position, view, making, time.time())
        if history.told is None:
            reset = _why_reset(history, position, view, making)
            history.told = view
            if reset is None:
                return
            publication = replace(publication, reset=reset)
        elif (waiting := history.waiting) is not None:
            publication = replace(publication, reset=waiting.reset, remade=waiting.remade)
        self._tell(site_id, history, publication)

    def on_remade(self, site_id: int, made: Remade) -> None:
        """Take the first view of a map that takes another's place: what differs is told."""
        history = self._histories.get(site_id)
        if history is None:
            return
        history.told = history.told or made.before
        publication = _Publication(
            made.position, made.view, made.making, time.time(), "the map was made anew", made.why
        )
        self._tell(site_id, history, publication)

    async def tell_silence(self, site_id: int, turned: Mapping[str, float | None]) -> bool:
        """Tell which robots are silent now, for how long [s], and which (None) are heard again.

        It is told beside the last view, and leaves the history where it was. False where that
        cannot be yet: while there is none, or another is being told.
        """
        await self.settled(site_id)
        history = self._histories.get(site_id)
        if history is None or history.told is None or not history.number:
            return False
        if history.task is not None and not history.task.done():
            return False
        history.task = asyncio.create_task(self._record_silence(site_id, history, turned))
        return True

    async def _record_silence(
        self, site_id: int, history: _History, turned: Mapping[str, float | None]
    ) -> None:
        assert history.told is not None
        told = encode(silence_events(history.told, turned, time.time(), settled=history.settled))
        batch = EventBatch(
            history.number + 1, history.position, history.version, history.producer, pack(told)
        )
        try:
            await self._store.write_as_engine(append_events, site_id, batch, self._kept)
        except StoreError:
            _LOG.exception("events of silent robots are not kept")
        else:
            history.number = batch.number
            self._hub.add(site_id, batch.number, told)
        await self._record(site_id, history)  # what came meanwhile

    def _tell(self, site_id: int, history: _History, publication: _Publication) -> None:
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
            events = await asyncio.to_thread(_events, history.told, publication)
            told = encode(events)
            batch = EventBatch(
                history.number + 1,
                publication.position,
                publication.view.version,
                publication.making,
                pack(told),
            )
            try:
                for event in events:
                    if isinstance(event, wire.RemadeEvent):
                        await self._store.write(put_file, site_id, "remade", as_file(event))
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
                history.settled = publication.view.settled
                self._hub.add(site_id, batch.number, told)


def _why_reset(history: _History, position: int, view: SiteView, making: str) -> str | None:
    """Tell why the history cannot go on from this view, None where it can."""
    if history.number and history.producer != making:
        return "another version of the service has made the map anew"
    if (position, view.version, view.settled) != (
        history.position,
        history.version,
        history.settled,
    ):
        return "the map was made anew, and not all that happened meanwhile was recorded"
    return None


def _events(before: SiteView, publication: _Publication) -> list[wire.AnyEvent]:
    view, at = publication.view, publication.at
    if publication.reset is None:
        return events_between(before, view, at)
    reset = wire.ResetEvent(version=view.version, at=at, reason=publication.reset)
    if publication.remade is None:
        return [reset]
    return [remade_event(before, view, publication.remade, at), reset]
