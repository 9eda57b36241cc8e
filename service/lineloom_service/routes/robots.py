"""Robots of a site."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from lineloom import wire
from lineloom_core.mapping.answers.site_view import SiteView
from pydantic import ValidationError

from lineloom_service.answers import answer
from lineloom_service.convert import to_mount, to_robot
from lineloom_service.dependencies import (
    CurrentView,
    KnownRobot,
    KnownSite,
    RobotName,
    ServiceDep,
    SiteName,
    find_robot,
    known_site,
)
from lineloom_service.errors import field_errors, invalid_body
from lineloom_service.openapi import body_of
from lineloom_service.request_body import read_body
from lineloom_service.service import Service
from lineloom_service.store.actions import forget_robot, set_mount
from lineloom_service.store.codec import encode_mount
from lineloom_service.store.records import RobotRecord, SiteRecord

router = APIRouter(tags=["robots"])


@router.get("/v1/sites/{site}/robots", response_model=wire.RobotList)
async def list_robots(site: KnownSite, view: CurrentView, service: ServiceDep) -> Response:
    """Return the robots of a site."""
    robots = [_robot(site, site.robots[name], view, service) for name in sorted(site.robots)]
    return answer(
        wire.RobotList(site=site.name, version=view.version, settled=view.settled, robots=robots)
    )


@router.get("/v1/sites/{site}/robots/{robot}", response_model=wire.Robot)
async def get_robot(
    site: KnownSite, robot: KnownRobot, view: CurrentView, service: ServiceDep
) -> Response:
    """Return a robot at its latest processed scan."""
    return answer(_robot(site, robot, view, service))


@router.put(
    "/v1/sites/{site}/robots/{robot}",
    response_model=wire.Robot,
    openapi_extra=body_of("RobotSettings"),
)
async def put_robot(
    site: SiteName, robot: RobotName, request: Request, service: ServiceDep
) -> Response:
    """Set how the lidar sits on the robot, for the scans that follow; without mount: nowhere."""
    body = await read_body(request, service.settings)
    try:
        settings = wire.RobotSettings.model_validate(body.value)
    except ValidationError as error:
        raise invalid_body(field_errors(error)) from None
    mount = None if settings.mount is None else encode_mount(to_mount(settings.mount))
    await service.store.write(set_mount, site, robot, mount)
    record = await known_site(site, service)
    view = service.conductor.published(record.id).view
    return answer(_robot(record, find_robot(record, robot), view, service))


@router.delete("/v1/sites/{site}/robots/{robot}", status_code=204)
async def delete_robot(site: KnownSite, robot: KnownRobot, service: ServiceDep) -> Response:
    """Forget a robot: what it alone has seen leaves the map. Its name may start anew."""
    await service.store.write(forget_robot, site.name, robot.name)
    service.conflicts.forget(site.id, robot.name)
    return Response(status_code=204)


def _robot(site: SiteRecord, robot: RobotRecord, view: SiteView, service: Service) -> wire.Robot:
    conflict = service.conflicts.finding(site.id, robot.name)
    heard = service.arrivals.heard(site.id, robot)
    return to_robot(site.name, robot, view, service.conductor.skips(site.id), heard, conflict)
