"""One listener's way through a site's history."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncGenerator, Sequence
from dataclasses import dataclass, replace

from lineloom import wire

from lineloom_service.events.codec import Place, Told, encode, unpack
from lineloom_service.events.hub import EventHub
from lineloom_service.store.protocol import Store
from lineloom_service.store.reads import read_events, read_last_events

_PORTION = 32
"""Batches read from the store at a time: what one listener costs in memory."""


@dataclass(frozen=True, slots=True)
class Message:
    """What a listener gets. place: where it is after it. event: None only moves the place."""

    place: Place
    event: Told | None


class EventFeed:
    """Gives a listener the events after its place, and then new ones as they come.

    poll_s: how often the store is looked at where other processes may write to it.
    """

    def __init__(self, store: Store, hub: EventHub, site_id: int, poll_s: float | None) -> None:
        self._store = store
        self._hub = hub
        self._site_id = site_id
        self._poll_s = poll_s
        self._place = Place(site_id, 0)

    async def start(self, last_event_id: str | None, version: int) -> Message:
        """Take the listener's place: where it left off, or at the end of what there is so far.

        Returns a `reset` where the history does not reach back to where it left off. version: the
        site's now.
        """
        last = await self._store.read(read_last_events, self._site_id)
        end = Place(self._site_id, 0 if last is None else last.number)
        if not last_event_id:
            self._place = end
            return Message(end, None)
        wanted = Place.parse(last_event_id)
        if wanted is not None and wanted.site_id == self._site_id and wanted.number <= end.number:
            back = wanted.number if wanted.seen is None else wanted.number - 1
            following = await self._store.read(read_events, self._site_id, max(0, back), 1)
            reaches_back = back == end.number or (following and following[0].number == back + 1)
            if back >= 0 and reaches_back:
                self._place = wanted
                return Message(wanted, None)
        self._place = end
        reason = "the history does not reach back to where this listener left off"
        return Message(end, _reset(version, reason))

    async def messages(self, pause_s: float, *, follow: bool) -> AsyncGenerator[Message | None]:
        """Yield what comes after the place; None after `pause_s` without any.

        Ends when the site is deleted or the service stops, or, unless `follow`, with what is.
        """
        quiet_since = time.monotonic()
        while not self._hub.is_closed(self._site_id):
            news = self._hub.next_news(self._site_id)
            messages = await self._next_messages()
            for message in messages:
                self._place = message.place
                yield message
            if messages:
                quiet_since = time.monotonic()
                continue
            if not follow:
                return
            await self._wait(news, pause_s)
            if time.monotonic() - quiet_since >= pause_s:
                quiet_since = time.monotonic()
                yield None

    async def _wait(self, news: asyncio.Event, pause_s: float) -> None:
        pause = pause_s if self._poll_s is None else min(pause_s, self._poll_s)
        with contextlib.suppress(TimeoutError):
            # Not `wait_for`: a listener's cancellation that comes with news would be lost.
            async with asyncio.timeout(pause):
                await news.wait()

    async def _next_messages(self) -> list[Message]:
        place = self._place
        after = place.number if place.seen is None else place.number - 1
        batches = self._hub.recent(self._site_id, after)
        if not batches:
            stored = await self._store.read(read_events, self._site_id, after, _PORTION)
            if stored and stored[0].number != after + 1:
                reason = "this listener was too slow, what it has not read is no longer kept"
                end = Place(self._site_id, stored[-1].number)
                return [Message(end, _reset(stored[-1].version, reason))]
            batches = [(batch.number, unpack(batch.body)) for batch in stored]
        return [
            message
            for number, events in batches
            for message in _messages(self._site_id, number, events)
            if (number, message.place.seen) > (place.number, place.seen or 0)
        ]


def _messages(site_id: int, number: int, events: Sequence[Told]) -> list[Message]:
    place = Place(site_id, number)
    return [
        Message(replace(place, seen=index), event) for index, event in enumerate(events, start=1)
    ]


def _reset(version: int, reason: str) -> Told:
    (told,) = encode([wire.ResetEvent(version=version, at=time.time(), reason=reason)])
    return told
