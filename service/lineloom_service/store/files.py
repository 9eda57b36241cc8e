"""Files that belong to a site: exports that never change, its floor plan, how it was remade."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from sqlalchemy import Connection, delete, insert, select

from lineloom_service.store import tables
from lineloom_service.store.transaction import Transaction

FileKind = Literal["export", "floorplan", "remade"]


@dataclass(frozen=True, slots=True)
class FileRecord:
    """name: unique within the site and kind. about: what is known of it, as JSON. created: seconds
    since 1970. data: None where only the record was asked for."""

    name: str
    about: str
    sha256: str
    size: int
    created: float
    data: bytes | None = None


def put_file(tx: Transaction, site_id: int, kind: FileKind, file: FileRecord) -> bool:
    """Keep a file, in the place of one of its name; False where the site is gone."""
    if all(site.id != site_id for site in tx.ledger.sites.values()):
        return False
    delete_file(tx, site_id, kind, file.name)
    tx.connection.execute(
        insert(tables.files).values(
            site_id=site_id,
            kind=kind,
            name=file.name,
            about=file.about,
            sha256=file.sha256,
            size=file.size,
            created=file.created,
            data=file.data,
        )
    )
    return True


def delete_file(tx: Transaction, site_id: int, kind: FileKind, name: str) -> bool:
    """Remove a file; False where there is none of that name."""
    c = tables.files.c
    gone = tx.connection.execute(
        delete(tables.files).where(c.site_id == site_id, c.kind == kind, c.name == name)
    )
    return bool(gone.rowcount)


def read_file(connection: Connection, site_id: int, kind: FileKind, name: str) -> FileRecord | None:
    """Return a file with its data."""
    c = tables.files.c
    query = select(c.name, c.about, c.sha256, c.size, c.created, c.data).where(
        c.site_id == site_id, c.kind == kind, c.name == name
    )
    row = connection.execute(query).first()
    return None if row is None else FileRecord(*row)


def list_files(connection: Connection, site_id: int, kind: FileKind) -> list[FileRecord]:
    """Return the files of a kind, oldest first, without their data."""
    c = tables.files.c
    query = (
        select(c.name, c.about, c.sha256, c.size, c.created)
        .where(c.site_id == site_id, c.kind == kind)
        .order_by(c.created, c.name)
    )
    return [FileRecord(*row) for row in connection.execute(query)]
