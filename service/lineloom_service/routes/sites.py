"""Sites."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from lineloom import wire

from lineloom_service.answers import answer
from lineloom_service.convert import to_remaking, to_site
from lineloom_service.dependencies import KnownSite, ServiceDep
from lineloom_service.service import Service
from lineloom_service.store import actions
from lineloom_service.store.records import SiteRecord

router = APIRouter(tags=["sites"])


@router.get("/v1/sites", response_model=wire.SiteList)
async def list_sites(request: Request, service: ServiceDep) -> Response:
    """Return all sites; with a token of one site, that one."""
    only = request.state.only_site
    records = [site for site in await service.store.sites() if only in (None, site.name)]
    sites = [await _site(record, service) for record in records]
    return answer(wire.SiteList(sites=sites))


@router.get("/v1/sites/{site}", response_model=wire.Site)
async def get_site(site: KnownSite, service: ServiceDep) -> Response:
    """Return how a site is doing. `idle`: all that was accepted is in the map.

    `trouble`: what is wrong just now, such as a log that cannot be read, a worker that hangs or a
    disk that is full; else null. `overloaded`: scans come faster than they are mapped, and wait for
    more than five seconds; `suggested_rate_hz` is what each robot may send then.
    """
    return answer(await _site(site, service))


@router.delete("/v1/sites/{site}", status_code=204)
async def delete_site(site: KnownSite, service: ServiceDep) -> Response:
    """Forget a site: its map and all its scans."""
    deleted = await service.store.write(actions.delete_site, site.name)
    if deleted is not None:
        await service.conductor.forget_site(deleted)
        service.maps.forget_site(deleted)
    return Response(status_code=204)


async def _site(record: SiteRecord, service: Service) -> wire.Site:
    conductor = service.conductor
    return to_site(
        record,
        conductor.published(record.id),
        service.trouble(record.id),
        to_remaking(await conductor.remaking_anywhere(record)),
        service.loads.of(record),
    )
