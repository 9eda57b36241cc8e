"""Asking a site's mapper, with the problems that a client is told of."""

from __future__ import annotations

import asyncio
from typing import Any

from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.answers.view_change import EMPTY_VIEW, ViewChange

from lineloom_service.engine.protocol import QuestionFailedError, WorkerDiedError
from lineloom_service.errors import INTERNAL, NOT_READY, ProblemError
from lineloom_service.service import Service
from lineloom_service.store.records import SiteRecord

_PATIENCE_S = 30.0


async def ask(service: Service, site: SiteRecord, question: str, *arguments: object) -> Any:
    """Return the mapper's answer. Raises ProblemError where it cannot be had just now."""
    try:
        async with asyncio.timeout(_PATIENCE_S):
            return await service.conductor.ask(site.id, question, *arguments)
    except (TimeoutError, WorkerDiedError):
        detail = f"the mapper of site {site.name!r} does not answer just now; try again"
        raise ProblemError(NOT_READY, detail, headers={"Retry-After": "2"}) from None
    except QuestionFailedError as error:
        raise ProblemError(INTERNAL, f"the mapper could not answer: {error}") from None


async def settled_view(service: Service, site: SiteRecord, view: SiteView) -> SiteView:
    """Return the view if it is settled, else ask for the settled one of just now.

    Raises ProblemError where that cannot be had just now.
    """
    if view.settled:
        return view
    found: ViewChange = await ask(service, site, "settled")
    return await asyncio.to_thread(found.apply, EMPTY_VIEW)
