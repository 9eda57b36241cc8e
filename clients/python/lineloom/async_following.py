"""Following a site's events, across lost connections and restarts of the service."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import httpx
from httpx_sse import EventSource

from lineloom import calls
from lineloom.calls import Name
from lineloom.errors import ProblemError
from lineloom.event_stream import Course, Lost
from lineloom.session import Session
from lineloom.wire import AnyEvent


async def follow(
    http: httpx.AsyncClient,
    session: Session,
    site: Name,
    last_event_id: str | None,
    until_now: bool,
) -> AsyncIterator[AnyEvent]:
    """Yield a site's events; see `AsyncClient.events`."""
    course = Course(session, calls.events(site, not until_now), last_event_id)
    while True:
        lost: Lost = None
        try:
            async with http.stream(**course.request()) as response:
                if not response.is_success:
                    await response.aread()
                calls.raise_for_problem(response)
                async for sent in EventSource(response).aiter_sse():
                    event = course.take(sent)
                    if event is not None:
                        yield event
        except (httpx.TransportError, ProblemError) as error:
            lost = error
        if lost is None and until_now:
            return
        await asyncio.sleep(course.pause(lost))
