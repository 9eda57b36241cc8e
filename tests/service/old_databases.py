"""Databases as each earlier version of the service left them, with rows in all their tables."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import sqlalchemy as sa
from lineloom_service.store.migrate import migrate
from lineloom_service.store.records import NewScan
from lineloom_service.store.sqlite_engine import sqlite_engine

Rows = dict[str, list[dict[str, Any]]]
"""Table -> its rows."""

REVISIONS = ("0001", "0002", "0003", "0004", "0005", "0006", "0007", "0008", "0009", "0010")

SCANS = [NewScan("0", seq, b"scan %d" % seq) for seq in (0, 1, 2, 4)]

_MOUNT = {"id": 1, "site_id": 1, "robot_id": 1, "kind": "mount", "body": b"m", "position": 1}
_ENTRIES = [
    {
        "id": number,
        "site_id": 1,
        "robot_id": 1,
        "kind": "scan",
        "stream_id": 1,
        "seq": scan.seq,
        "body": scan.body,
        "position": None if scan.seq == 4 else number,
    }
    for number, scan in enumerate(SCANS, 2)
]
_SNAPSHOT = {"site_id": 1, "position": 4, "scans": 3, "producer": "v1", "data": b"old"}
_EVENT = {"site_id": 1, "number": 1, "position": 4, "version": 7, "producer": "v1", "body": b"e"}
_TOKEN = {"id": "t", "digest": "d", "scopes": "read", "note": "", "created": 1.5}
_FILE = {
    "site_id": 1,
    "kind": "export",
    "name": "a",
    "about": "{}",
    "sha256": "s",
    "size": 1,
    "created": 1.5,
    "data": b"f",
}

_ADDED: dict[str, Rows] = {
    "0001": {
        "sites": [{"id": 1, "name": "site", "position": 4}],
        "robots": [
            {"id": 1, "site_id": 1, "name": "r", "mount": b"m", "forgotten": False},
            {"id": 2, "site_id": 1, "name": "gone", "mount": None, "forgotten": True},
        ],
        "streams": [
            {"id": 1, "robot_id": 1, "session": "0", "released": 2, "highest": 4, "accepted": 4}
        ],
        "entries": [_MOUNT | {"stream_id": None, "seq": None}, *_ENTRIES],
    },
    "0002": {
        "skips": [{"site_id": 1, "position": 3, "reason": "the mapper failed"}],
        "snapshots": [_SNAPSHOT],
    },
    "0003": {"events": [_EVENT]},
    "0004": {"views": [{"site_id": 1, "position": 4, "data": b"v"}]},
    "0005": {"tokens": [_TOKEN]},
    "0006": {"files": [_FILE]},
    "0007": {"questions": [{"id": "q", "question": b"?"}]},
    "0008": {
        "chapters": [{"site_id": 1, "producer": "v1", "number": 0, "crc": 1, "data": b"c"}],
    },
    "0009": {},
    "0010": {
        "tombstones": [{"id": 1, "kind": "site", "site_id": 7, "name": "gone", "at": 1.5}],
    },
}


def make_old(connection: sa.Connection, revision: str) -> None:
    """Make a database of this revision: two robots, a mount, a held scan, and what else it had."""
    for step in REVISIONS[: REVISIONS.index(revision) + 1]:
        migrate(connection, step)
        for name, rows in _ADDED[step].items():
            table = sa.Table(name, sa.MetaData(), autoload_with=connection)
            connection.execute(sa.insert(table), rows)


def make_old_file(path: Path, revision: str) -> None:
    """Make a SQLite file of this revision."""
    engine = sqlite_engine(path)
    with engine.begin() as connection:
        make_old(connection, revision)
    engine.dispose()


def read_all(connection: sa.Connection) -> Rows:
    """Return all that a database holds."""
    metadata = sa.MetaData()
    metadata.reflect(connection)
    return {
        name: [dict(row) for row in connection.execute(sa.select(table)).mappings()]
        for name, table in sorted(metadata.tables.items())
        if name != "alembic_version"
    }
