"""A site: one floor of one building."""

from __future__ import annotations

from lineloom.wire.base import Answer, Settled


class ScanCounts(Answer):
    """accepted = durable; processed = in the map; skipped = taken, but the mapper refused it.

    accepted = processed + skipped + pending.
    """

    accepted: int
    processed: int
    pending: int
    skipped: int = 0


class Component(Answer):
    """A set of trajectory pieces whose relative poses are known."""

    id: str
    robots: list[str]
    keyframes: int


class Remaking(Answer):
    """The map is being made anew, beside the one that is shown, up to `position` of `of` entries.

    why: what differs from what the shown one was made with.
    """

    position: int
    of: int
    why: str


class Site(Answer):
    """How a site is doing.

    idle: all that was accepted is in the map, loops and merges included, and the map has settled.
    constraints: counts by kind and, within it, by state.
    merged_into: id of an absorbed component -> id of its survivor.
    trouble: why it is not mapped just now, None where all is well.
    remaking: how far the map is that will be shown instead of this one, None where none is made.
    overloaded: scans come faster than they are mapped. suggested_rate_hz: what each robot that
    sends may send then, None where all is well.
    """

    site: str
    version: int
    settled: Settled = False
    idle: bool
    scans: ScanCounts
    robots: list[str]
    components: list[Component]
    merged_into: dict[str, str]
    constraints: dict[str, dict[str, int]]
    trouble: str | None = None
    remaking: Remaking | None = None
    overloaded: bool = False
    suggested_rate_hz: float | None = None


class SiteList(Answer):
    """All sites."""

    sites: list[Site]
