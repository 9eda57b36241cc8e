"""Which robots send scans under names that other scans have, and what that most likely means."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from lineloom_service.store.records import Conflict

_REMEMBERED = 100
_QUIET = 500
"""Scans taken without a conflict after which nothing is said any more."""


@dataclass(slots=True)
class _Robot:
    refused: int = 0
    taken: int = 0
    since: int = 0
    seqs: deque[int] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))


class Conflicts:
    """Counts by site and robot, for as long as the process lives: the metrics have them longer."""

    def __init__(self) -> None:
        self._robots: dict[tuple[int, str], _Robot] = {}

    def note(self, site_id: int, robot: str, accepted: int, conflicts: Iterable[Conflict]) -> None:
        """Take what became of a request."""
        found = list(conflicts)
        known = self._robots.get((site_id, robot))
        if known is None and not found:
            return
        if known is None:
            known = self._robots[site_id, robot] = _Robot()
        known.refused += len(found)
        known.taken += accepted
        known.since = 0 if found else known.since + accepted
        known.seqs.extend(conflict.seq for conflict in found)
        if known.since >= _QUIET:
            del self._robots[site_id, robot]

    def finding(self, site_id: int, robot: str) -> str | None:
        """Say what is wrong with how a robot's scans are named, None where nothing is."""
        known = self._robots.get((site_id, robot))
        if known is None:
            return None
        said = (
            f"conflict: {known.refused} scans were refused, {known.taken} taken since: their "
            "session has other scans of the same seq"
        )
        if len(set(known.seqs)) == 1 and len(known.seqs) > 1:
            return f"{said}. seq is {known.seqs[0]} again and again: count it up, or leave it out"
        return (
            f"{said}. Either two robots send under this name: give each its own; or the counter "
            "began again: begin another session then, or leave seq out"
        )

    def forget(self, site_id: int, robot: str | None = None) -> None:
        """Forget a robot, or a site's all."""
        for key in [k for k in self._robots if k[0] == site_id and robot in (None, k[1])]:
            del self._robots[key]
