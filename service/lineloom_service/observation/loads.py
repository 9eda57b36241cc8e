"""Whether sites are sent more than is mapped in time, and how much it may be."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from lineloom_service.store.records import SiteRecord

LATE_S = 5.0
"""From here on a backlog is too much: so long it would take to work off."""

_WINDOW_S, _EVERY_S, _LEAST_S = 20.0, 0.5, 2.0


@dataclass(frozen=True, slots=True)
class Load:
    """is_over: scans wait longer than they should. rate_hz: that each robot may send then."""

    is_over: bool = False
    rate_hz: float | None = None


@dataclass(slots=True)
class _Site:
    """rows: time [s] and entries mapped; heard: how many each robot had sent, and when last."""

    rows: deque[tuple[float, int]] = field(default_factory=deque)
    heard: dict[str, tuple[int, float]] = field(default_factory=dict)


class Loads:
    """Watches the log and the map grow. processed: how far a site's mapper is, by the site's id."""

    def __init__(
        self, processed: Callable[[int], int], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._processed, self._clock = processed, clock
        self._sites: dict[int, _Site] = {}

    def on_commit(self, record: SiteRecord) -> None:
        """A site changed."""
        if record.deleted:
            self._sites.pop(record.id, None)
            return
        now, site = self._clock(), self._sites.setdefault(record.id, _Site())
        for robot in record.robots.values():
            count, _ = site.heard.get(robot.name, (0, now))
            if robot.accepted != count:
                site.heard[robot.name] = robot.accepted, now
        if not site.rows or now - site.rows[-1][0] >= _EVERY_S:
            site.rows.append((now, self._processed(record.id)))
        while now - site.rows[0][0] > _WINDOW_S:
            site.rows.popleft()

    def of(self, record: SiteRecord) -> Load:
        """Return whether a site is sent too much now."""
        site, now = self._sites.get(record.id), self._clock()
        processed = self._processed(record.id)
        waiting = record.position - processed
        if site is None or waiting <= 0 or not site.rows or now - site.rows[0][0] < _LEAST_S:
            return Load()
        began, mapped = site.rows[0]
        rate = (processed - mapped) / (now - began)
        if waiting <= LATE_S * rate:
            return Load()
        sending = sum(now - at < _WINDOW_S for _, at in site.heard.values())
        return Load(True, round(rate / max(sending, 1), 2))
