"""What was deleted on purpose: so that it stays deleted where a former copy is restored."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Literal

from sqlalchemy import Connection, insert, select

from lineloom_service.store import tables
from lineloom_service.store.transaction import Transaction

TombstoneKind = Literal["site", "robot", "export", "floorplan", "remade"]


@dataclass(frozen=True, slots=True)
class Tombstone:
    """name: of the site or the file; of a robot its number. at: seconds since 1970."""

    kind: TombstoneKind
    site_id: int
    name: str
    at: float


def bury(tx: Transaction, kind: TombstoneKind, site_id: int, name: str) -> None:
    """Note that this was deleted."""
    stone = Tombstone(kind, site_id, name, time.time())
    tx.connection.execute(insert(tables.tombstones).values(**asdict(stone)))


def read_tombstones(connection: Connection) -> list[Tombstone]:
    """Return all, in the order made."""
    c = tables.tombstones.c
    query = select(c.kind, c.site_id, c.name, c.at).order_by(c.id)
    return [Tombstone(*row) for row in connection.execute(query)]


def add_tombstones(connection: Connection, stones: Iterable[Tombstone]) -> list[Tombstone]:
    """Keep those that a restored copy does not have; return them."""
    known = set(read_tombstones(connection))
    missing = [stone for stone in stones if stone not in known]
    if missing:
        connection.execute(insert(tables.tombstones), [asdict(stone) for stone in missing])
    return missing
