"""Sites."""

from __future__ import annotations

from fastapi import APIRouter, Response
from lineloom import wire

from lineloom_service.answers import answer
from lineloom_service.convert import to_site
from lineloom_service.dependencies import KnownSite, ServiceDep

router = APIRouter(tags=["sites"])


@router.get("/v1/sites", response_model=wire.SiteList)
async def list_sites(service: ServiceDep) -> Response:
    """Return all sites."""
    records = await service.store.sites()
    sites = [to_site(record, service.conductor.published(record.id)) for record in records]
    return answer(wire.SiteList(sites=sites))


@router.get("/v1/sites/{site}", response_model=wire.Site)
async def get_site(site: KnownSite, service: ServiceDep) -> Response:
    """Return how a site is doing. `idle`: all that was accepted is in the map."""
    return answer(to_site(site, service.conductor.published(site.id)))


@router.delete("/v1/sites/{site}", status_code=204)
async def delete_site(site: KnownSite, service: ServiceDep) -> Response:
    """Forget a site: its map and all its scans."""
    deleted = await service.store.delete_site(site.name)
    if deleted is not None:
        await service.conductor.forget_site(deleted)
        service.maps.forget_site(deleted)
    return Response(status_code=204)
