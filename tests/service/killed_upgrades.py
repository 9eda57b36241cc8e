"""Upgrades of a SQLite file that are killed, each at another step.

`python -m tests.service.killed_upgrades SOURCE DIRECTORY` upgrades copies of SOURCE, DIRECTORY/1,
DIRECTORY/2, …, each in a process of its own that gets SIGKILL as its 1st, 2nd, … step begins, and
ends with one that gets through. A step is a statement that may change a file, one of SQLite's own
within VACUUM included, or the renaming of a file.
"""

from __future__ import annotations

import functools
import itertools
import os
import shutil
import signal
import sqlite3
import sys
from pathlib import Path
from typing import Any

from lineloom_service.store import sqlite_upgrade

_HARMLESS = ("SELECT", "PRAGMA")


def kill_at(number: int) -> None:
    """Kill this process as its `number`th step begins."""
    steps = itertools.count(1)

    def step() -> None:
        if next(steps) == number:
            os.kill(os.getpid(), signal.SIGKILL)

    class Traced(sqlite3.Connection):
        def __init__(self, database: str, *arguments: Any, **named: Any) -> None:
            super().__init__(database, *arguments, **named)
            if database != ":memory:":
                self.set_trace_callback(
                    lambda statement: None if statement.startswith(_HARMLESS) else step()
                )

    connect = functools.partial(sqlite3.connect, factory=Traced)
    sqlite3.connect = sqlite3.dbapi2.connect = connect  # type: ignore[assignment]
    sys.addaudithook(lambda event, _: step() if event == "os.rename" else None)


def main(source: Path, directory: Path) -> None:
    """Upgrade copies of `source` until one is not killed."""
    # The same for all, so found out once, by the first that gets there alive.
    sqlite_upgrade._columns_from = functools.cache(sqlite_upgrade._columns_from)
    for number in itertools.count(1):
        home = directory / str(number)
        home.mkdir()
        if source.exists():
            shutil.copy(source, home / "lineloom.db")
        if (child := os.fork()) == 0:
            kill_at(number)
            sqlite_upgrade.upgrade_file(home / "lineloom.db")
            os._exit(0)
        _, status = os.waitpid(child, 0)
        if status == 0:
            return
        if not (os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL):
            raise SystemExit(f"the upgrade in {home} failed")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
