"""How long it takes from `202` until what was accepted is in the published map."""

from __future__ import annotations

import time
from collections import deque

from lineloom_service.observation.durations import Histogram
from lineloom_service.store.records import SiteRecord

_MOST = 10_000
"""Commits of a site remembered; of a longer backlog the rest is not measured."""


class Latency:
    """Remembers when a site's log grew, until the map has caught up."""

    def __init__(self) -> None:
        self.histogram = Histogram()
        self._waiting: dict[int, deque[tuple[int, float]]] = {}

    def on_commit(self, record: SiteRecord) -> None:
        """The site's log goes up to `record.position` now."""
        waiting = self._waiting.setdefault(record.id, deque(maxlen=_MOST))
        if not waiting or waiting[-1][0] < record.position:
            waiting.append((record.position, time.monotonic()))

    def on_view(self, site_id: int, position: int, _: object) -> None:
        """The published map has all up to `position`."""
        waiting = self._waiting.get(site_id)
        now = time.monotonic()
        while waiting and waiting[0][0] <= position:
            self.histogram.observe(now - waiting.popleft()[1])
