"""How a command fails: one clear line that says what to do next, and a documented exit code."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum

from lineloom.errors import (
    AccessDeniedError,
    ConnectionFailedError,
    LineloomError,
    NotIdleError,
    ProblemError,
    UnexpectedAnswerError,
)


class Exit(IntEnum):
    """Exit codes of every command."""

    OK = 0
    FAILED = 1
    USAGE = 2
    UNREACHABLE = 3
    NEGATIVE = 4


EXIT_CODES = """Exit codes:
  0  done
  1  it failed: a file or the service said no; the message says why
  2  the command line is wrong
  3  the service cannot be reached
  4  done, but the answer is no: no match, robots not merged, map not idle in time, no place in
     the floor plan, the doctor found something wrong, or the database is damaged"""

_NEXT = {
    "unknown-site": "`lineloom status` lists the sites.",
    "unknown-robot": "`lineloom status --site NAME` lists the robots.",
    "unknown-component": "`lineloom status --site NAME` lists the components.",
    "unknown-export": "`lineloom export list` lists them.",
    "no-floor-plan": "Send one with `lineloom floorplan put FILE`.",
    "not-registered": "`lineloom floorplan show` says how it stands with each component.",
    "not-connected": "Let them drive through the same rooms.",
    "not-ready": "Wait a little, or ask `lineloom doctor`.",
    "backlog-full": "Wait until the map has caught up: `lineloom status` says how far it is.",
    "storage": "Is the server's disk full? Its log says more.",
    "internal": "The server's log says more.",
}
"""What to do about a problem of the service, by the last part of its type."""

_NO = {"not-registered", "not-connected"}
"""Problems that are answers."""


class CommandError(Exception):
    """Ends a command. The message is one line; `code` is the exit code."""

    def __init__(self, message: str, code: Exit = Exit.FAILED) -> None:
        super().__init__(message)
        self.code = code


@contextmanager
def needing_core(what: str) -> Iterator[None]:
    """Say what to install where an import finds no core. what: needs it, in the plural.

    Raises CommandError.
    """
    try:
        yield
    except ImportError:
        raise CommandError(f"{what} need the core: `pip install lineloom-client[server]`") from None


def explained(error: Exception) -> CommandError | None:
    """Return what to tell the user of an error, or None for one that is a bug of ours."""
    if isinstance(error, CommandError):
        return error
    if isinstance(error, ConnectionFailedError):
        return CommandError(
            f"{error}. Start a service with `lineloom serve`, or name one with --url or "
            "LINELOOM_URL.",
            Exit.UNREACHABLE,
        )
    if isinstance(error, NotIdleError):
        return CommandError(f"{error}. See `lineloom status` later.", Exit.NEGATIVE)
    if isinstance(error, AccessDeniedError):
        return CommandError(f"{error}. Give a token with --token or LINELOOM_TOKEN.")
    if isinstance(error, UnexpectedAnswerError):
        return CommandError(f"{error}. Is this address a Lineloom service of this version?")
    if isinstance(error, ProblemError):
        slug = error.type.rsplit("/", 1)[-1]
        advice = f". {_NEXT[slug]}" if slug in _NEXT else ""
        return CommandError(f"{error}{advice}", Exit.NEGATIVE if slug in _NO else Exit.FAILED)
    if isinstance(error, LineloomError):
        return CommandError(str(error))
    if isinstance(error, OSError) and error.filename is not None:
        return CommandError(f"{error.filename}: {error.strerror}")
    return None
