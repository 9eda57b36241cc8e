"""Following a site's events, across lost connections and restarts of the service."""

from __future__ import annotations

import time
from collections.abc import Iterator

import httpx
from httpx_sse import EventSource

from lineloom import calls
from lineloom.calls import Name
from lineloom.errors import ProblemError
from lineloom.event_stream import Course, Lost
from lineloom.session import Session
from lineloom.wire import AnyEvent


def follow(
    http: httpx.Client,
    session: Session,
    site: Name,
    last_event_id: str | None,
    until_now: bool,
) -> Iterator[AnyEvent]:
    """Yield a site's events; see `Client.events`."""
    course = Course(session, calls.events(site, not until_now), last_event_id)
    while True:
        lost: Lost = None
        try:
            with http.stream(**course.request()) as response:
                if not response.is_success:
                    response.read()
                calls.raise_for_problem(response)
                for sent in EventSource(response).iter_sse():
                    event = course.take(sent)
                    if event is not None:
                        yield event
        except (httpx.TransportError, ProblemError) as error:
            lost = error
        if lost is None and until_now:
            return
        time.sleep(course.pause(lost))
