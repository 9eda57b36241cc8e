"""What routes ask for: the service, names, and records of what exists.

All of it is `async`: FastAPI runs plain functions on a thread, at ten times their cost.
"""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, Path, Request
from lineloom.wire import ID_PATTERN
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.errors import UNKNOWN_ROBOT, UNKNOWN_SITE, ProblemError
from lineloom_service.security.quotas import hold
from lineloom_service.security.scopes import ABOUT_NO_SITE, scope_of
from lineloom_service.service import Service
from lineloom_service.store.records import RobotRecord, SiteRecord

SiteName = Annotated[
    str, Path(alias="site", pattern=ID_PATTERN, description="One floor of one building.")
]
RobotName = Annotated[str, Path(alias="robot", pattern=ID_PATTERN, description="A robot's name.")]


async def get_service(request: Request) -> Service:
    """Return the service behind the app."""
    service: Service = request.app.state.service
    return service


ServiceDep = Annotated[Service, Depends(get_service)]


async def admitted(request: Request, service: ServiceDep) -> None:
    """Let pass whoever has a token with the route's scope, or answer 401, 403 or 429.

    Without tokens: whoever does not come by another's name or page, or answer 421 or 403.
    """
    path: str = request.scope["route"].path
    names = request.path_params
    token = await service.guard.admit(
        request.headers.get("authorization"),
        scope_of(request.method, path),
        names.get("site"),
        names.get("robot"),
        anywhere=path in ABOUT_NO_SITE,
    )
    request.state.token_id = None if token is None else token.id
    request.state.only_site = None if token is None else token.site
    if token is None:
        server = request.scope.get("server") or (None, None)
        service.hosts.check(request.method, request.headers, server[0])
    else:
        hold(request.scope, service.quotas.take(token.id, stream=path.endswith("/events")))


async def known_site(name: SiteName, service: ServiceDep) -> SiteRecord:
    """Return a site that exists, or 404."""
    record = await service.store.site(name)
    if record is None:
        raise ProblemError(UNKNOWN_SITE, f"no site {name!r}; it is created by its first scan")
    return record


KnownSite = Annotated[SiteRecord, Depends(known_site)]


async def current_view(site: KnownSite, service: ServiceDep) -> SiteView:
    """Return the latest published view of a site; never waits for the mapper."""
    return service.conductor.published(site.id).view


CurrentView = Annotated[SiteView, Depends(current_view)]


def find_robot(site: SiteRecord, name: str) -> RobotRecord:
    """Return a robot of the site, or raise the 404."""
    record = site.robots.get(name)
    if record is None:
        raise ProblemError(UNKNOWN_ROBOT, f"no robot {name!r} in site {site.name!r}")
    return record


async def known_robot(site: KnownSite, name: RobotName) -> RobotRecord:
    """Return a robot that exists, or 404."""
    return find_robot(site, name)


KnownRobot = Annotated[RobotRecord, Depends(known_robot)]
