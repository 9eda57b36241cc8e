"""When each robot was last heard, by this server's clock, and which have fallen silent."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

from lineloom_service.store.records import RobotRecord, SiteRecord


@dataclass(frozen=True, slots=True)
class Heard:
    """received: when its last scan came [s since 1970], None where that was before this process
    began. silent_for_s: since then, or since this process began. is_silent: for too long.
    """

    received: float | None
    silent_for_s: float
    is_silent: bool


class Arrivals:
    """Remembers when a robot's count of scans last grew, whoever took them.

    silent_after_s: how long a robot that has sent scans may send none.
    """

    def __init__(self, silent_after_s: float) -> None:
        self._silent_after_s = silent_after_s
        self._began = time.monotonic()
        self._counts: dict[tuple[int, str], int] = {}
        self._last: dict[tuple[int, str], tuple[float, float]] = {}
        self._told: dict[int, frozenset[str]] = {}

    def begin(self, record: SiteRecord) -> None:
        """Take what a site holds already for old."""
        for robot in record.robots.values():
            self._counts.setdefault((record.id, robot.name), robot.accepted)

    def on_commit(self, record: SiteRecord) -> None:
        """A site changed."""
        if record.deleted:
            for key in [key for key in self._counts if key[0] == record.id]:
                self._counts.pop(key)
                self._last.pop(key, None)
            return
        for robot in record.robots.values():
            key = record.id, robot.name
            if robot.accepted != self._counts.get(key, 0):
                self._last[key] = time.time(), time.monotonic()
            self._counts[key] = robot.accepted

    def heard(self, site_id: int, robot: RobotRecord) -> Heard:
        """Return when a robot was last heard."""
        received, at = self._last.get((site_id, robot.name), (None, self._began))
        silent = max(0.0, time.monotonic() - at)
        return Heard(received, silent, robot.accepted > 0 and silent > self._silent_after_s)

    def silent(self, record: SiteRecord) -> dict[str, float]:
        """Return the robots of a site that are silent, and for how long [s]."""
        heard = {name: self.heard(record.id, robot) for name, robot in record.robots.items()}
        return {name: h.silent_for_s for name, h in heard.items() if h.is_silent}

    def turned(self, record: SiteRecord) -> dict[str, float | None]:
        """Return who fell silent since it was told last, for how long [s]; None: heard again."""
        now, before = self.silent(record), self._told.get(record.id, frozenset())
        known = now.keys() | (before & record.robots.keys())
        return {n: now.get(n) for n in sorted(known) if (n in now) != (n in before)}

    def note_told(self, site_id: int, turned: Mapping[str, float | None]) -> None:
        """Remember that this was told."""
        silent = {name for name, seconds in turned.items() if seconds is not None}
        self._told[site_id] = (self._told.get(site_id, frozenset()) - turned.keys()) | silent
