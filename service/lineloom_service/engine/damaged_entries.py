"""Entries of a log that cannot be read any more: left out, and told for as long as they are."""

from __future__ import annotations

import logging
from collections.abc import Iterable

from lineloom_service.store.actions import record_skip
from lineloom_service.store.feed_order import FeedOrder
from lineloom_service.store.protocol import Store
from lineloom_service.store.reads import read_entry, read_skips
from lineloom_service.store.records import DamagedError, LogEntry, Skip

_LOG = logging.getLogger(__name__)

DAMAGED = "damaged"
"""What the reason begins with for which such an entry is skipped."""


def describe_damage(skips: Iterable[Skip]) -> str | None:
    """Return which entries are left out for that reason, None where there are none."""
    found = sorted((s for s in skips if s.reason.startswith(DAMAGED)), key=lambda s: s.position)
    if not found:
        return None
    first = found[0]
    whose = f" (robot {first.robot}, seq {first.seq})" if first.seq is not None else ""
    more = f", and {len(found) - 1} more" if len(found) > 1 else ""
    return f"entry {first.position} of its log{whose} is damaged and left out{more}"


async def read_the_whole_ones(
    store: Store, site: int, order: FeedOrder, after: int, count: int, skips: dict[int, Skip]
) -> list[LogEntry]:
    """Read what is fed next, entry by entry. Damaged ones come without body, and are in `skips`."""
    in_order = after < order.position
    positions = (
        order.feed(after, count).tolist() if in_order else range(after + 1, after + count + 1)
    )
    entries: list[LogEntry] = []
    for position in positions:
        try:
            entry = await store.read(read_entry, site, position)
        except DamagedError as error:
            entry = await _leave_out(store, site, position, f"{DAMAGED}: {error}", skips)
        if entry is not None:
            entries.append(entry)
    return entries


async def _leave_out(
    store: Store, site: int, position: int, reason: str, skips: dict[int, Skip]
) -> LogEntry:
    _LOG.error("site %d, entry %d: %s", site, position, reason)
    await store.write_as_engine(record_skip, site, position, reason)
    (skip,) = await store.read(read_skips, site, position)
    skips[position] = skip
    return LogEntry(position, skip.kind, skip.robot, skip.session, skip.seq, None)
