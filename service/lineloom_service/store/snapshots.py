"""Snapshots of a site's mapper, and the chapters of its history that they go on from.

A chapter never changes, and every later snapshot of the same producer goes on from it as well: it
is written once, and stays for as long as a kept snapshot needs it.
"""

from __future__ import annotations

import zlib
from collections.abc import AsyncIterator

from sqlalchemy import Connection, and_, delete, func, insert, or_, select

from lineloom_service.store import tables
from lineloom_service.store.protocol import Store
from lineloom_service.store.records import ChapterLostError, SnapshotRecord
from lineloom_service.store.transaction import Transaction

_KEPT = 2
_PURGE_PORTION = 20
"""Chapters removed in one commit with a deleted site: some megabytes."""


def save_snapshot(tx: Transaction, site_id: int, snapshot: SnapshotRecord) -> None:
    """Keep a snapshot with its new chapters, and the last one before it.

    Those of other producers stay until the one that the log orders is as far. Nothing is kept of a
    site that is gone.
    """
    site = next((site for site in tx.ledger.sites.values() if site.id == site_id), None)
    if site is None:
        return
    is_last = site.is_in_force(snapshot.producer)
    connection = tx.connection
    c = tables.snapshots.c
    connection.execute(
        delete(tables.snapshots).where(c.site_id == site_id, c.position == snapshot.position)
    )
    connection.execute(
        insert(tables.snapshots).values(
            site_id=site_id,
            position=snapshot.position,
            scans=snapshot.scans,
            producer=snapshot.producer,
            data=snapshot.data,
            chapters=snapshot.end,
        )
    )
    _write_chapters(connection, site_id, snapshot)
    own = c.producer == snapshot.producer
    kept = (
        select(c.position).where(c.site_id == site_id, own).order_by(c.position.desc()).limit(_KEPT)
    )
    outdated = and_(own, c.position.not_in(kept))
    if is_last:
        outdated = or_(outdated, and_(~own, c.position < snapshot.position))
    connection.execute(delete(tables.snapshots).where(c.site_id == site_id, outdated))
    _prune_chapters(connection, site_id)


def drop_snapshot(tx: Transaction, site_id: int, position: int) -> None:
    """Remove one snapshot, and the chapters that only it went on from."""
    c = tables.snapshots.c
    tx.connection.execute(
        delete(tables.snapshots).where(c.site_id == site_id, c.position == position)
    )
    _prune_chapters(tx.connection, site_id)


def read_snapshot(
    connection: Connection, site_id: int, producer: str, up_to: int | None = None
) -> SnapshotRecord | None:
    """Return the newest snapshot that `producer` wrote, without chapters.

    up_to: of those up to this position.
    """
    c = tables.snapshots.c
    query = (
        select(c.position, c.scans, c.producer, c.data, c.chapters)
        .where(c.site_id == site_id, c.producer == producer)
        .order_by(c.position.desc())
        .limit(1)
    )
    if up_to is not None:
        query = query.where(c.position <= up_to)
    row = connection.execute(query).first()
    return None if row is None else SnapshotRecord(*row)


def saved_position(connection: Connection, site_id: int, producer: str) -> int:
    """Return how far the newest snapshot is that `producer` wrote; 0 without any."""
    c = tables.snapshots.c
    query = select(func.max(c.position)).where(c.site_id == site_id, c.producer == producer)
    return connection.execute(query).scalar() or 0


def read_chapter(connection: Connection, site_id: int, producer: str, number: int) -> bytes:
    """Return a chapter as it was saved. Raises ChapterLostError."""
    c = tables.chapters.c
    query = select(c.crc, c.data).where(
        c.site_id == site_id, c.producer == producer, c.number == number
    )
    row = connection.execute(query).first()
    if row is None:
        raise ChapterLostError(f"chapter {number} of its history is lost")
    data: bytes = row.data
    if zlib.crc32(data) != row.crc:
        raise ChapterLostError(f"chapter {number} of its history is damaged")
    return data


async def read_chapters(
    store: Store, site_id: int, snapshot: SnapshotRecord
) -> AsyncIterator[bytes]:
    """Read the chapters that a snapshot goes on from, each when it is asked for.

    Raises ChapterLostError where one is not there as it was saved.
    """
    for number in range(snapshot.end):
        yield await store.read(read_chapter, site_id, snapshot.producer, number)


def purge_chapters(connection: Connection, site_id: int) -> bool:
    """Remove some chapters of a deleted site; False where there were none."""
    c = tables.chapters.c
    portion = select(c.number).where(c.site_id == site_id).limit(_PURGE_PORTION)
    gone = connection.execute(
        delete(tables.chapters).where(c.site_id == site_id, c.number.in_(portion))
    )
    return bool(gone.rowcount)


def _write_chapters(connection: Connection, site_id: int, snapshot: SnapshotRecord) -> None:
    """Write what is new. After a rebuild from the log the same numbers come again: they replace."""
    if not snapshot.chapters:
        return
    c = tables.chapters.c
    connection.execute(
        delete(tables.chapters).where(
            c.site_id == site_id,
            c.producer == snapshot.producer,
            c.number >= snapshot.first,
            c.number < snapshot.end,
        )
    )
    rows = [
        {
            "site_id": site_id,
            "producer": snapshot.producer,
            "number": number,
            "crc": zlib.crc32(data),
            "data": data,
        }
        for number, data in enumerate(snapshot.chapters, snapshot.first)
    ]
    connection.execute(insert(tables.chapters), rows)


def _prune_chapters(connection: Connection, site_id: int) -> None:
    """Remove the chapters that no kept snapshot of their producer goes on from."""
    c, s = tables.chapters.c, tables.snapshots.c
    needed = (
        select(func.coalesce(func.max(s.chapters), 0))
        .where(s.site_id == site_id, s.producer == c.producer)
        .correlate(tables.chapters)
        .scalar_subquery()
    )
    connection.execute(delete(tables.chapters).where(c.site_id == site_id, c.number >= needed))
