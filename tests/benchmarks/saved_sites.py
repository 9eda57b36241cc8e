"""What a service has saved of its sites, read from its database by somebody else."""

from __future__ import annotations

import sqlite3
import time
from contextlib import closing
from pathlib import Path

_POLL_S = 0.2


def saved_bytes(folder: Path, timeout_s: float = 120.0) -> int:
    """Wait until the one site there is saved to its last entry; size of its state [bytes].

    That is what every snapshot writes anew, without the chapters of history that it goes on from.
    """
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        with closing(_open(folder)) as database:
            (end,) = database.execute("SELECT MAX(position) FROM entries").fetchone()
            query = "SELECT LENGTH(data) FROM snapshots WHERE position = ?"
            found = database.execute(query, (end,)).fetchone()
        if found is not None:
            return int(found[0])
        time.sleep(_POLL_S)
    raise TimeoutError(f"not saved after {timeout_s:g} s: {folder}")


def log_bytes(folder: Path) -> int:
    """Size of a stopped service's database without snapshots and their chapters [bytes]."""
    with closing(_open(folder)) as database:
        (free, page, pages), snapshots, chapters = (
            next(database.execute(query))
            for query in (
                "SELECT * FROM pragma_freelist_count, pragma_page_size, pragma_page_count",
                "SELECT COALESCE(SUM(LENGTH(data)), 0) FROM snapshots",
                "SELECT COALESCE(SUM(LENGTH(data)), 0) FROM chapters",
            )
        )
    return int((pages - free) * page - snapshots[0] - chapters[0])


def drop_snapshots(folder: Path) -> None:
    """Leave a service that has stopped nothing but the log."""
    with closing(_open(folder)) as database, database:
        database.execute("DELETE FROM snapshots")
        database.execute("DELETE FROM chapters")


def _open(folder: Path) -> sqlite3.Connection:
    return sqlite3.connect(folder / "lineloom.db", timeout=30.0)
