"""Where listeners wait for the next batch of a site's events."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from lineloom_service.events.codec import Told

_RECENT = 16
"""Batches of a site kept at hand for those who keep up; the others read the store."""


@dataclass(slots=True)
class _Channel:
    recent: deque[tuple[int, Sequence[Told]]] = field(default_factory=lambda: deque(maxlen=_RECENT))
    news: asyncio.Event = field(default_factory=asyncio.Event)


class EventHub:
    """The latest batches by site, and who waits for more. Nobody has a queue."""

    def __init__(self) -> None:
        self._channels: dict[int, _Channel] = {}
        self._closed: set[int] = set()
        self.listeners = 0
        self.stopping = False

    def add(self, site_id: int, number: int, events: Sequence[Told]) -> None:
        """Hand on a batch that is on the disk."""
        channel = self._channel(site_id)
        channel.recent.append((number, events))
        self._wake(channel)

    def wake(self, site_id: int) -> None:
        """Another process has stored a batch: those who wait are to look into the store."""
        channel = self._channels.get(site_id)
        if channel is not None:
            channel.recent.clear()
            self._wake(channel)

    def recent(self, site_id: int, after: int) -> list[tuple[int, Sequence[Told]]]:
        """Return the batches after `after`; empty also where the first one is not at hand."""
        channel = self._channels.get(site_id)
        if channel is None:
            return []
        found = [(number, events) for number, events in channel.recent if number > after]
        return found if found and found[0][0] == after + 1 else []

    def close_site(self, site_id: int) -> None:
        """A site is gone: let its listeners know."""
        self._closed.add(site_id)
        channel = self._channels.pop(site_id, None)
        if channel is not None:
            channel.news.set()

    def stop(self) -> None:
        """The service ends: let every listener go."""
        self.stopping = True
        for channel in self._channels.values():
            self._wake(channel)

    def is_closed(self, site_id: int) -> bool:
        """Whether there is nothing more to come."""
        return self.stopping or site_id in self._closed

    def next_news(self, site_id: int) -> asyncio.Event:
        """Return what is set with the next batch. Ask for it before looking what there is."""
        return self._channel(site_id).news

    def _channel(self, site_id: int) -> _Channel:
        return self._channels.setdefault(site_id, _Channel())

    def _wake(self, channel: _Channel) -> None:
        channel.news.set()
        channel.news = asyncio.Event()
