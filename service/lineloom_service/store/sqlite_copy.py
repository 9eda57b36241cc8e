"""The copy that is kept of a SQLite file before it is upgraded."""

from __future__ import annotations

import logging
import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from itertools import count, zip_longest
from pathlib import Path
from typing import Any

_LOG = logging.getLogger(__name__)


def keep_copy(path: Path, revision: str, columns: Mapping[str, Sequence[str]]) -> None:
    """Have a whole copy of the file beside it, as it is before its upgrade.

    A start that did not get through the upgrade has left one already: where it holds the same rows
    of the revision's `columns`, it is the copy. No copy takes the place of another one.
    Raises OSError, sqlite3.Error.
    """
    first = f"{path.name}.backup-{revision}"
    # Under another name until it is whole: what bears the name of a backup is one.
    unfinished = path.with_name(f"{first}.unfinished")
    for cut_short in path.parent.glob(f"{first}*.unfinished"):
        cut_short.unlink()
    for number in count(1):
        copy = path.with_name(first if number == 1 else f"{first}.{number}")
        if not copy.exists():
            break
        if _hold_the_same(path, copy, columns):
            _LOG.warning(
                "the database is of revision %s and is upgraded; %s is its copy", revision, copy
            )
            return
    try:
        with closing(sqlite3.connect(path)) as connection:
            connection.execute("VACUUM INTO ?", (str(unfinished),))
        _sync(unfinished)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise
    unfinished.rename(copy)
    _sync(path.parent)
    _LOG.warning("the database is of revision %s and is upgraded; a copy is %s", revision, copy)


def _hold_the_same(one: Path, other: Path, columns: Mapping[str, Sequence[str]]) -> bool:
    try:
        with closing(_open(one)) as first, closing(_open(other)) as second:
            return all(
                mine == other
                for table, names in columns.items()
                for mine, other in zip_longest(
                    _rows(first, table, names), _rows(second, table, names)
                )
            )
    except sqlite3.Error:  # not a database, or not one of this revision
        return False


def _open(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)


def _rows(connection: sqlite3.Connection, table: str, names: Sequence[str]) -> Iterator[Any]:
    return connection.execute(f"SELECT {', '.join(names)} FROM {table} ORDER BY rowid")


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
