"""What is said of an error of the database, whichever layer it comes from."""

from __future__ import annotations

import errno
import sqlite3

import pytest
from lineloom_service.store.failure import failure_of
from lineloom_service.store.records import StorageFullError, StoreError
from sqlalchemy.exc import DBAPIError, OperationalError


class _DriverError(Exception):
    """An error as asyncpg has them."""

    def __init__(self, text: str, sqlstate: str) -> None:
        super().__init__(text)
        self.sqlstate = sqlstate


def _wrapped(driver: BaseException) -> DBAPIError:
    return OperationalError("INSERT INTO entries", {"body": b"secret"}, driver)


def _sqlite(sql: str) -> sqlite3.Error:
    connection = sqlite3.connect(":memory:")
    connection.execute("CREATE TABLE t (x)")
    connection.execute("PRAGMA max_page_count = 2")
    with pytest.raises(sqlite3.Error) as caught:
        connection.execute(sql)
    return caught.value


FULL = "INSERT INTO t VALUES (zeroblob(1000000))"


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, "No space left on device"),
        OSError(errno.EDQUOT, "Disk quota exceeded"),
        _sqlite(FULL),
        _wrapped(_sqlite(FULL)),
        _wrapped(_DriverError("could not extend file", "53100")),
    ],
)
def test_no_room_is_told_as_such(error: BaseException) -> None:
    assert isinstance(failure_of(error), StorageFullError)


@pytest.mark.parametrize(
    "error",
    [
        ConnectionRefusedError(errno.ECONNREFUSED, "Connect call failed"),
        _wrapped(ConnectionResetError("Connection lost")),
        _wrapped(_DriverError("the database system is shutting down", "57P01")),
        _wrapped(_DriverError("connection does not exist", "08003")),
    ],
)
def test_a_database_that_is_away_is_told_with_the_reason(error: BaseException) -> None:
    said = str(failure_of(error))
    assert said.startswith("the database is out of reach: ")
    driver = getattr(error, "orig", error)
    assert (getattr(driver, "strerror", None) or str(driver)) in said


def test_anything_else_is_told_in_the_drivers_words_alone() -> None:
    said = str(failure_of(_wrapped(_sqlite("SELECT * FROM nowhere"))))
    assert said == "the storage failed: OperationalError: no such table: nowhere"
    assert str(failure_of(StoreError("as it is"))) == "as it is"
