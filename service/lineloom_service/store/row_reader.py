"""All rows of a table, portion by portion, around whatever cannot be read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from sqlalchemy import Connection, Integer, Select, Table, func, select, tuple_
from sqlalchemy.exc import DBAPIError

from lineloom_service.store.damage import is_damage

Row = dict[str, Any]
Lost = Callable[[str], None]
"""Told of what cannot be read."""

_LARGE = ("snapshots", "chapters", "views", "files")
_PORTION, _LARGE_PORTION = 500, 8


def read_rows(connection: Connection, table: Table, lost: Lost) -> Iterator[list[Row]]:
    """Yield rows in the order of the table's key, by portions that fit into memory."""
    key = list(table.primary_key)
    most = _LARGE_PORTION if table.name in _LARGE else _PORTION
    portion, last = most, None
    while True:
        query = select(table).order_by(*key).limit(portion)
        rows = _try(connection, query if last is None else query.where(tuple_(*key) > last))
        if rows is None and portion > 1:
            portion = 1
        elif rows is None:
            last = _step_over(connection, table, last, lost)
            if last is None:
                return
        elif not rows:
            return
        else:
            yield rows
            last = tuple(rows[-1][column.name] for column in key)
            portion = most


def _try(connection: Connection, query: Select[Any]) -> list[Row] | None:
    """Return what a query finds; None where something of it is damaged."""
    try:
        with connection.begin_nested():  # an error ends a transaction on PostgreSQL
            return [dict(row) for row in connection.execute(query).mappings()]
    except DBAPIError as error:
        if not is_damage(error):
            raise
        return None


def _step_over(
    connection: Connection, table: Table, last: tuple[Any, ...] | None, lost: Lost
) -> tuple[Any, ...] | None:
    """Return the key of a row that cannot be read, to go on behind it; None where that is none."""
    key = list(table.primary_key)
    query = select(*key).order_by(*key).limit(1)
    found = _try(connection, query if last is None else query.where(tuple_(*key) > last))
    if found:
        lost(f"{table.name}: row {', '.join(str(v) for v in found[0].values())} cannot be read")
        return tuple(found[0].values())
    (end,) = _try(connection, select(func.max(key[0]).label("end"))) or [{"end": None}]
    countable = len(key) == 1 and isinstance(key[0].type, Integer)
    if not countable or end["end"] is None or (last is not None and last[0] >= end["end"]):
        lost(f"{table.name}: what comes after {last or 'its begin'} cannot be read")
        return None
    following = 1 if last is None else last[0] + 1
    lost(f"{table.name}: row {following} cannot be read")
    return (following,)
