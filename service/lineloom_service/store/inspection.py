"""Looks through a database for what is not as it was written."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field

from sqlalchemy import Connection, Table

from lineloom_service.store import tables
from lineloom_service.store.checksum import is_whole
from lineloom_service.store.row_reader import Row, read_rows


@dataclass(slots=True)
class Findings:
    """entries: how many there are. unchecked: of them, those from before there were checksums.
    damage: what is wrong, in words."""

    entries: int = 0
    unchecked: int = 0
    damage: list[str] = field(default_factory=list)


def inspect_all(connection: Connection) -> Findings:
    """Read every row of every table and compare it with its checksum, where it has one."""
    found = Findings()
    sites: dict[int, str] = {}
    robots: dict[int, str] = {}
    for table in tables.metadata.sorted_tables:
        for rows in read_rows(connection, table, found.damage.append):
            for row in rows:
                if table is tables.sites:
                    sites[row["id"]] = row["name"]
                elif table is tables.robots:
                    robots[row["id"]] = row["name"]
                elif table is tables.entries:
                    found.entries += 1
                    found.unchecked += row["crc"] is None
                if not _is_whole(table, row):
                    found.damage.append(_describe(table, row, sites, robots))
    found.damage += _of_the_file(connection)
    return found


def _is_whole(table: Table, row: Row) -> bool:
    if table is tables.entries:
        return is_whole(row)
    if table is tables.chapters:
        return zlib.crc32(row["data"]) == int(row["crc"])
    if table is tables.files:
        return hashlib.sha256(row["data"]).hexdigest() == str(row["sha256"])
    return True


def _describe(table: Table, row: Row, sites: dict[int, str], robots: dict[int, str]) -> str:
    site = sites.get(row["site_id"], f"number {row['site_id']}")
    if table is tables.entries:
        where = "a scan that waits" if row["position"] is None else f"entry {row['position']}"
        seq = "" if row["seq"] is None else f", seq {row['seq']}"
        return (
            f"site {site}: {where} (robot {robots.get(row['robot_id'], 'unknown')}{seq}) is not "
            "what was written"
        )
    what = f"chapter {row['number']}" if table is tables.chapters else f"file {row['name']}"
    return f"site {site}: {what} is not what was written"


def _of_the_file(connection: Connection) -> Iterator[str]:
    """Have SQLite look at what is not rows: indexes, and pages that nothing refers to."""
    if connection.dialect.name == "sqlite":
        for (said,) in connection.exec_driver_sql("PRAGMA quick_check(20)"):
            if said != "ok":
                yield f"the file: {said}"
