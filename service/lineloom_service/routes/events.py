"""What happens to a site, as it happens."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncGenerator
from typing import Annotated

from fastapi import APIRouter, Header, Query, Request, Response

from lineloom_service.dependencies import CurrentView, KnownSite, ServiceDep
from lineloom_service.errors import TOO_MANY_STREAMS, ProblemError
from lineloom_service.events.feed import EventFeed, Message
from lineloom_service.events.stream import EventStream
from lineloom_service.openapi import events_of
from lineloom_service.service import Service
from lineloom_service.store.records import SiteRecord

router = APIRouter(tags=["events"])


@router.get("/v1/sites/{site}/events", response_class=Response, responses=events_of("Event"))
async def get_events(
    request: Request,
    site: KnownSite,
    view: CurrentView,
    service: ServiceDep,
    last_event_id: Annotated[
        str | None,
        Header(description="The `id` of the last event that arrived: go on right after it."),
    ] = None,
    follow: Annotated[
        bool, Query(description="false: end with the events there are so far.")
    ] = True,
) -> Response:
    """Follow a site by Server-Sent Events: `scan`, `robot`, `constraint`, `component-merged`,
    `component-split`, `map`, and `reset`.

    Each has an `id`; with the latest as `Last-Event-ID` a listener goes on where it left off, also
    after a restart of the service. `reset` says that this is not possible: load everything anew.
    Without `Last-Event-ID` it begins with what happens from now on.
    """
    settings = service.settings
    if service.events.listeners >= settings.event_streams:
        detail = f"{service.events.listeners} listeners are connected, more are not taken"
        raise ProblemError(TOO_MANY_STREAMS, detail, headers={"Retry-After": "10"})
    feed = EventFeed(service.store, service.events, site.id, poll_s=None)
    first = await feed.start(last_event_id, view.version)
    following = feed.messages(settings.heartbeat_s, follow=follow)
    messages = _counted(service, site, request.state.token_id, first, following)
    return EventStream(messages, settings.slow_reader_s)


async def _counted(
    service: Service,
    site: SiteRecord,
    token_id: str | None,
    first: Message,
    following: AsyncGenerator[Message | None],
) -> AsyncGenerator[Message | None]:
    service.events.listeners += 1
    service.metrics.listeners.set(service.events.listeners)
    try:
        yield first
        async with contextlib.aclosing(following):
            async for message in following:
                if not service.guard.still_good(token_id):
                    return
                # Another process may have deleted it, or somebody made another of its name.
                if message is None and not await _exists(service, site):
                    return
                yield message
    finally:
        service.events.listeners -= 1
        service.metrics.listeners.set(service.events.listeners)


async def _exists(service: Service, site: SiteRecord) -> bool:
    now = await service.store.site(site.name)
    return now is not None and now.id == site.id
