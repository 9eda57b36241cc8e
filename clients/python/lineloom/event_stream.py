"""Where a listener to a site's events is, across lost connections and restarts of the service."""

from __future__ import annotations

from typing import Any

import httpx
from httpx_sse import ServerSentEvent
from pydantic import ValidationError

from lineloom.calls import Call
from lineloom.errors import ConnectionFailedError, ProblemError
from lineloom.session import Session
from lineloom.wire import AnyEvent, Event

_SILENCE_S = 60.0
"""The service sends a comment every few seconds: after this long without, nobody is there."""

Lost = httpx.TransportError | ProblemError | None
"""Why a connection ended: an error, or None where the service ended it in good order."""


class Course:
    """Where the listener is, and how often in a row it was not let in."""

    def __init__(self, session: Session, call: Call[None], last_event_id: str | None) -> None:
        self._session = session
        self._call = call
        self._last = last_event_id or ""
        self._failures = 0

    def request(self) -> dict[str, Any]:
        """Return the keyword arguments of `httpx.Client.stream`."""
        options = self._session.request_options(self._call)
        if self._last:
            options["headers"]["Last-Event-ID"] = self._last
        del options["content"]
        options["timeout"] = httpx.Timeout(self._session.timeout, read=_SILENCE_S)
        return options

    def take(self, sent: ServerSentEvent) -> AnyEvent | None:
        """Return the event, None for a type that this client is too old to know."""
        self._failures = 0
        self._last = sent.id or self._last
        try:
            event = Event.model_validate_json(sent.data).root
        except ValidationError:
            return None
        return event.model_copy(update={"id": sent.id})

    def pause(self, lost: Lost) -> float:
        """Return how long to wait before the next attempt [s], or raise what ended it."""
        if lost is None:
            return self._session.retry.pause(0)
        if isinstance(lost, ProblemError):
            pause = self._session.retry.after_status(self._failures, lost.status, lost.retry_after)
        else:
            pause = self._session.retry.after_failure(self._failures)
        self._failures += 1
        if pause is None and isinstance(lost, ProblemError):
            raise lost
        if pause is None:
            reason = str(lost) or type(lost).__name__
            raise ConnectionFailedError(self._session.url, reason, self._failures) from lost
        return pause
