"""What is asked of the database, beside the writer."""

from __future__ import annotations

from sqlalchemy import Connection, RowMapping, func, select
from sqlalchemy.exc import DBAPIError

from lineloom_service.store import tables
from lineloom_service.store.checksum import is_whole
from lineloom_service.store.damage import is_damage
from lineloom_service.store.feed_order import FeedOrder
from lineloom_service.store.records import (
    DamagedError,
    EntryKind,
    EventBatch,
    LogEntry,
    Skip,
    ViewRecord,
)


def read_revision(connection: Connection) -> int:
    """Return the clock's count of commits that changed a site."""
    revision: int = connection.execute(select(tables.clock.c.revision)).scalar_one()
    return revision


def read_term(connection: Connection) -> int:
    """Return the number of the engine that has the right to map."""
    term: int = connection.execute(select(tables.clock.c.term)).scalar_one()
    return term


def read_feed(
    connection: Connection, site_id: int, after: int, limit: int, order: FeedOrder | None = None
) -> list[LogEntry]:
    """Return what is fed after the first `after` released entries. Raises DamagedError.

    order: of the feed, None: that of the log. One answer does not go across the entry that made it.
    """
    e = tables.entries.c
    query = (
        select(tables.entries, tables.robots.c.name, tables.streams.c.session)
        .join_from(tables.entries, tables.robots, tables.robots.c.id == e.robot_id)
        .outerjoin(tables.streams, tables.streams.c.id == e.stream_id)
        .where(e.site_id == site_id)
    )
    if order is None or after >= order.position:
        query = query.where(e.position > after).order_by(e.position).limit(limit)
        return [_entry(row) for row in connection.execute(query).mappings()]
    wanted: list[int] = order.feed(after, limit).tolist()
    found: dict[int, LogEntry] = {}
    # In portions: a database takes a limited number of parameters in a statement.
    for start in range(0, len(wanted), 500):
        portion = query.where(e.position.in_(wanted[start : start + 500]))
        rows = connection.execute(portion).mappings()
        found.update((row["position"], _entry(row)) for row in rows)
    return [found[position] for position in wanted if position in found]


def read_entry(connection: Connection, site_id: int, position: int) -> LogEntry | None:
    """Return the entry at a position; None where there is none. Raises DamagedError."""
    found = read_feed(connection, site_id, position - 1, 1)
    return found[0] if found and found[0].position == position else None


def _entry(row: RowMapping) -> LogEntry:
    if not is_whole(row):
        raise DamagedError(f"entry {row['position']} is not what was written")
    return LogEntry(
        row["position"], row["kind"], row["name"], row["session"], row["seq"], row["body"]
    )


def read_skips(connection: Connection, site_id: int, position: int | None = None) -> list[Skip]:
    """Return the skipped entries of a site, or the one at `position`."""
    k = tables.skips.c
    query = select(k.position, k.reason).where(k.site_id == site_id).order_by(k.position)
    if position is not None:
        query = query.where(k.position == position)
    return [
        Skip(at, *_who(connection, site_id, at), reason)
        for at, reason in connection.execute(query).all()
    ]


def _who(
    connection: Connection, site_id: int, position: int
) -> tuple[str, EntryKind, str | None, int | None]:
    """Return robot, kind, session and seq of an entry, as far as they can be read."""
    e = tables.entries.c
    query = (
        select(tables.robots.c.name, e.kind, tables.streams.c.session, e.seq)
        .join_from(tables.entries, tables.robots, tables.robots.c.id == e.robot_id)
        .outerjoin(tables.streams, tables.streams.c.id == e.stream_id)
        .where(e.site_id == site_id, e.position == position)
    )
    try:
        with connection.begin_nested():  # or what follows would fail as well on PostgreSQL
            row = connection.execute(query).first()
    except DBAPIError as error:
        if not is_damage(error):
            raise
        row = None
    return ("", "scan", None, None) if row is None else tuple(row)


def read_events(connection: Connection, site_id: int, after: int, limit: int) -> list[EventBatch]:
    """Return the batches of events after a number, in order."""
    c = tables.events.c
    query = (
        select(c.number, c.position, c.version, c.producer, c.body)
        .where(c.site_id == site_id, c.number > after)
        .order_by(c.number)
        .limit(limit)
    )
    return [EventBatch(*row) for row in connection.execute(query)]


def read_last_events(connection: Connection, site_id: int) -> EventBatch | None:
    """Return the newest batch of events."""
    c = tables.events.c
    query = (
        select(c.number, c.position, c.version, c.producer, c.body)
        .where(c.site_id == site_id)
        .order_by(c.number.desc())
        .limit(1)
    )
    row = connection.execute(query).first()
    return None if row is None else EventBatch(*row)


def read_last_number(connection: Connection, site_id: int) -> int:
    """Return the number of the newest batch of events, whether or not it can be read; 0: none."""
    c = tables.events.c
    found = connection.execute(select(func.max(c.number)).where(c.site_id == site_id)).scalar()
    return found or 0


def read_view(connection: Connection, site_id: int, at_least: int) -> ViewRecord | None:
    """Return the published view of a site, unless it is before position `at_least`."""
    c = tables.views.c
    query = select(c.position, c.data).where(c.site_id == site_id, c.position >= at_least)
    row = connection.execute(query).first()
    return None if row is None else ViewRecord(*row)
