"""What is asked of the database, beside the writer."""

from __future__ import annotations

from sqlalchemy import Connection, select

from lineloom_service.store import tables
from lineloom_service.store.feed_order import FeedOrder
from lineloom_service.store.records import EventBatch, LogEntry, Skip, ViewRecord


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
    """Return what is fed after the first `after` released entries.

    order: of the feed, None: that of the log. One answer does not go across the entry that made it.
    """
    e = tables.entries.c
    query = (
        select(e.position, e.kind, tables.robots.c.name, tables.streams.c.session, e.seq, e.body)
        .join_from(tables.entries, tables.robots, tables.robots.c.id == e.robot_id)
        .outerjoin(tables.streams, tables.streams.c.id == e.stream_id)
        .where(e.site_id == site_id)
    )
    if order is None or after >= order.position:
        query = query.where(e.position > after).order_by(e.position).limit(limit)
        return [LogEntry(*row) for row in connection.execute(query)]
    wanted: list[int] = order.feed(after, limit).tolist()
    found: dict[int, LogEntry] = {}
    # In portions: a database takes a limited number of parameters in a statement.
    for start in range(0, len(wanted), 500):
        portion = query.where(e.position.in_(wanted[start : start + 500]))
        found.update((row.position, LogEntry(*row)) for row in connection.execute(portion))
    return [found[position] for position in wanted if position in found]


def read_skips(connection: Connection, site_id: int, position: int | None = None) -> list[Skip]:
    """Return the skipped entries of a site, or the one at `position`."""
    e, k = tables.entries.c, tables.skips.c
    query = (
        select(e.position, tables.robots.c.name, e.kind, tables.streams.c.session, e.seq, k.reason)
        .join_from(
            tables.skips, tables.entries, (e.site_id == k.site_id) & (e.position == k.position)
        )
        .join(tables.robots, tables.robots.c.id == e.robot_id)
        .outerjoin(tables.streams, tables.streams.c.id == e.stream_id)
        .where(k.site_id == site_id)
        .order_by(k.position)
    )
    if position is not None:
        query = query.where(k.position == position)
    return [Skip(*row) for row in connection.execute(query)]


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


def read_view(connection: Connection, site_id: int, at_least: int) -> ViewRecord | None:
    """Return the published view of a site, unless it is before position `at_least`."""
    c = tables.views.c
    query = select(c.position, c.data).where(c.site_id == site_id, c.position >= at_least)
    row = connection.execute(query).first()
    return None if row is None else ViewRecord(*row)
