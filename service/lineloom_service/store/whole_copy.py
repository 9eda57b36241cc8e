"""A whole database copied row by row: to where it is kept, back, or to one of another kind."""

from __future__ import annotations

from collections.abc import Callable

from sqlalchemy import Connection, Table, bindparam, delete, func, insert, select, text, update

from lineloom_service.store import tables
from lineloom_service.store.checksum import is_whole
from lineloom_service.store.records import StoreError
from lineloom_service.store.row_reader import Row, read_rows

_MADE_ANEW = (tables.snapshots, tables.chapters, tables.events, tables.views, tables.questions)
"""What follows from the log, or is of this very moment."""

_NUMBERED = ("sites", "robots", "streams", "tombstones")
"""Tables that number their rows themselves: no number is given twice, also after a copy."""


def copy_all(source: Connection, target: Connection) -> int:
    """Copy every row to empty tables; return how many. Raises StoreError where one is damaged.

    Both are of the same revision. Whatever serves the copy serves what the original did.
    """

    def refuse(what: str) -> None:
        raise StoreError(f"{what}: `lineloom db salvage` saves what can be read")

    copied = 0
    for table in reversed(tables.metadata.sorted_tables):
        target.execute(delete(table))
    for table in tables.metadata.sorted_tables:
        for rows in read_rows(source, table, refuse):
            target.execute(insert(table), rows)
            copied += len(rows)
    _count_on(source, target)
    return copied


def salvage(source: Connection, target: Connection, lost: Callable[[str], None]) -> int:
    """Copy all of the log that is as it was written, and tokens and files; return how many rows.

    Maps are made anew from that. lost: told of all that is not in the copy.
    """
    copied = 0
    for table in reversed(tables.metadata.sorted_tables):
        target.execute(delete(table))
    for table in tables.metadata.sorted_tables:
        if table in _MADE_ANEW:
            continue
        for rows in read_rows(source, table, lost):
            kept = [row for row in rows if _is_usable(table, row, lost)]
            if kept:
                target.execute(insert(table), kept)
            copied += len(kept)
    if not target.execute(select(func.count()).select_from(tables.clock)).scalar():
        target.execute(insert(tables.clock).values(id=1))
    _forget_the_lost(target)
    return copied


def _is_usable(table: Table, row: Row, lost: Callable[[str], None]) -> bool:
    if table is not tables.entries or is_whole(row):
        return True
    lost(f"entries: row {row['id']} of site number {row['site_id']} is not what was written")
    return False


def _forget_the_lost(connection: Connection) -> None:
    """Have sites and sessions count what is there: what is lost is not waited for."""
    e, s, t = tables.entries.c, tables.streams.c, tables.sites.c
    counted = select(func.count()).where(e.stream_id == s.id).scalar_subquery()
    connection.execute(update(tables.streams).values(accepted=counted))
    ends = select(e.site_id, func.max(e.position)).group_by(e.site_id)
    for site, end in connection.execute(ends).all():
        query = update(tables.sites).where(t.id == bindparam("site"))
        connection.execute(query.values(position=bindparam("end")), {"site": site, "end": end or 0})


def _count_on(source: Connection, target: Connection) -> None:
    """Have the copy number new rows from where the original would have."""
    for name in _NUMBERED:
        last = max(_last_number(source, name), _largest(target, name))
        if target.dialect.name == "postgresql":
            sequence = f"pg_get_serial_sequence('{name}', 'id')"
            target.execute(text(f"SELECT setval({sequence}, :last, :any)"),
                           {"last": max(last, 1), "any": last > 0})  # fmt: skip
        elif name == "sites":
            target.exec_driver_sql("DELETE FROM sqlite_sequence WHERE name = 'sites'")
            target.exec_driver_sql("INSERT INTO sqlite_sequence VALUES ('sites', ?)", (last,))


def _last_number(connection: Connection, name: str) -> int:
    if connection.dialect.name == "postgresql":
        sequence = connection.execute(
            text("SELECT pg_get_serial_sequence(:name, 'id')"), {"name": name}
        ).scalar_one()
        query = text(f"SELECT CASE WHEN is_called THEN last_value ELSE 0 END FROM {sequence}")
        return int(connection.execute(query).scalar_one())
    if name != "sites":
        return 0
    query = text("SELECT seq FROM sqlite_sequence WHERE name = 'sites'")
    return int(connection.execute(query).scalar() or 0)


def _largest(connection: Connection, name: str) -> int:
    column = tables.metadata.tables[name].c.id
    return int(connection.execute(select(func.max(column))).scalar() or 0)
