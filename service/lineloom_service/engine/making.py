"""What a mapper is made with, and by which number the engine knows it.

A site may be mapped twice at a time: as it is served, and beside that with what it is to be made
with next. Each has a number of its own, which no other ever gets while the process lives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.digest import digest

from lineloom_service.store.config_entry import ConfigEntry
from lineloom_service.store.feed_order import making_id, parted
from lineloom_service.store.protocol import Store
from lineloom_service.store.reads import read_feed
from lineloom_service.store.records import SiteRecord
from lineloom_service.store.snapshots import read_snapshot

LATE = "scans came late, and take the places that they should have had"
"""Why a map is made anew of the same log, in another order."""

_SITES = 40
"""Bits of a host that are its site's id."""


@dataclass(frozen=True, slots=True)
class Making:
    """digest: of code, parameters and processor. since: the log entry that ordered it, 0: none.

    parameters: by name, nested; the defaults where they are not named. order: the log entry that
    says in which order it is fed, 0: in that of the log.
    """

    digest: str
    since: int
    parameters: Mapping[str, Any]
    order: int = 0

    @property
    def id(self) -> str:
        """What snapshots and events are keyed by."""
        return making_id(f"{self.digest}@{self.since}", self.order)

    @classmethod
    def of(cls, site: SiteRecord) -> Making:
        """Return what the log orders, or the defaults."""
        config = site.config
        if config is None:
            return cls(digest(MapperConfig()), 0, {}, site.order)
        return cls(config.digest, config.since, config.parameters, site.order)

    def why_not(self, other: str) -> str:
        """Say what differs from another's id."""
        if parted(other)[0] == parted(self.id)[0]:
            return LATE
        if _code(other) == _code(self.digest):
            return "other parameters"
        return "the mapper's code, its libraries or the processor are not what they were"


async def former_making(store: Store, site_id: int, named: str, now: Making) -> Making | None:
    """Return the making of this id if this code can still host it from a snapshot."""
    keyed, order = parted(named)
    made, _, since = keyed.partition("@")
    if _code(made) != _code(now.digest) or not since.isdigit():
        return None
    if await store.read(read_snapshot, site_id, named) is None:
        return None
    if since == "0":
        return Making(made, 0, {}, order)
    entries = await store.read(read_feed, site_id, int(since) - 1, 1)
    if not entries or entries[0].kind != "config" or entries[0].body is None:
        return None
    return Making(made, int(since), ConfigEntry.decode(entries[0].body).parameters, order)


def host_of(site_id: int, generation: int) -> int:
    """Return the engine's number for the site's mapper number `generation` in this process."""
    return site_id + (generation << _SITES)


def site_of(host: int) -> int:
    """Return the id of the site that it maps."""
    return host & ((1 << _SITES) - 1)


def _code(digest_of: str) -> str:
    return digest_of.partition(".")[0]
