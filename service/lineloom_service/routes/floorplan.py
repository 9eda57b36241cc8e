"""The floor plan of a site's building, and the map's place in it."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from lineloom import wire
from lineloom_core.floorplan.differences import Differences, differences
from lineloom_core.floorplan.plan import FloorPlanError, lengths
from lineloom_core.floorplan.registration import Registration
from lineloom_core.geometry import Pose
from lineloom_core.io.floorplan_drawing import draw_differences
from lineloom_core.io.floorplan_files import PlanFormat
from lineloom_core.io.png import PictureTooLargeError, to_png
from lineloom_core.io.svg import to_svg
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.answers import answer, format_choice, unknown_format
from lineloom_service.dependencies import CurrentView, KnownSite, ServiceDep
from lineloom_service.errors import (
    INVALID_BODY,
    INVALID_PARAMETER,
    NO_FLOOR_PLAN,
    NOT_REGISTERED,
    UNKNOWN_COMPONENT,
    UNSUPPORTED_TYPE,
    ProblemError,
)
from lineloom_service.floorplans import StoredPlan, judge_component, solid_lines
from lineloom_service.map_files import ray_source
from lineloom_service.openapi import also_as
from lineloom_service.request_body import read_raw
from lineloom_service.service import Service
from lineloom_service.store.records import SiteRecord

router = APIRouter(tags=["floor plan"])

_FORMATS: dict[str, PlanFormat] = {
    "application/geo+json": "geojson",
    "application/json": "geojson",
    "image/vnd.dxf": "dxf",
    "application/dxf": "dxf",
    "text/plain": "text",
    "text/csv": "text",
}
_DIFFERENCES = ("json", "svg", "png")
_BODY: dict[str, Any] = {
    "requestBody": {"required": True, "content": {name: {} for name in _FORMATS}}
}


@router.put("/v1/sites/{site}/floorplan", response_model=wire.FloorPlanAnswer, openapi_extra=_BODY)
async def put_floorplan(
    site: KnownSite, view: CurrentView, request: Request, service: ServiceDep
) -> Response:
    """Take the building's floor plan, and say where in it the map lies, or why that is open.

    The Content-Type tells what it is: GeoJSON, DXF, or text with `x1, y1, x2, y2` on each line, in
    metres.
    """
    content_type = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if content_type not in _FORMATS:
        detail = f"Content-Type is {content_type or 'missing'}; send {', '.join(_FORMATS)}"
        raise ProblemError(UNSUPPORTED_TYPE, detail, headers={"Accept": ", ".join(_FORMATS)})
    content = await read_raw(request, service.settings)
    try:
        plan = await service.plans.read(content, _FORMATS[content_type])
    except FloorPlanError as error:
        raise ProblemError(INVALID_BODY, f"the floor plan: {error}") from None
    stored = await service.floorplans.put(site, plan)
    return answer(await _describe(service, site, view, stored))


@router.get("/v1/sites/{site}/floorplan", response_model=wire.FloorPlanAnswer)
async def get_floorplan(site: KnownSite, view: CurrentView, service: ServiceDep) -> Response:
    """Return where in the floor plan each component of the map lies, as far as that is known."""
    return answer(await _describe(service, site, view, await _plan(service, site)))


@router.delete("/v1/sites/{site}/floorplan", status_code=204)
async def delete_floorplan(site: KnownSite, service: ServiceDep) -> Response:
    """Forget the floor plan."""
    if not await service.floorplans.remove(site):
        raise _none(site)
    return Response(status_code=204)


@router.get(
    "/v1/sites/{site}/floorplan/differences",
    response_model=wire.PlanDifferences,
    responses=also_as("image/svg+xml", "image/png"),
)
async def get_differences(
    site: KnownSite,
    view: CurrentView,
    service: ServiceDep,
    format: Annotated[str, format_choice(_DIFFERENCES)] = "json",
    component: Annotated[
        str | None, Query(description="Which; the one with a place in the plan if left out.")
    ] = None,
) -> Response:
    """Return walls of the plan that are missing, and walls that it does not have."""
    if format not in _DIFFERENCES:
        raise unknown_format(format, _DIFFERENCES)
    stored = await _plan(service, site)
    chosen, T = await _placed(service, site, view, stored, component)
    judge = await judge_component(stored.plan, ray_source(service, site, view), view, chosen)
    found = await asyncio.to_thread(differences, judge, T)
    if format == "json":
        return answer(_differences(site, view, chosen, found))
    drawing = await asyncio.to_thread(draw_differences, found)
    if format == "svg":
        return Response(to_svg(drawing), media_type="image/svg+xml")
    try:
        return Response(await asyncio.to_thread(to_png, drawing), media_type="image/png")
    except PictureTooLargeError as error:
        raise ProblemError(INVALID_PARAMETER, f"format: {error}") from None


async def _plan(service: Service, site: SiteRecord) -> StoredPlan:
    stored = await service.floorplans.plan(site)
    if stored is None:
        raise _none(site)
    return stored


async def _describe(
    service: Service, site: SiteRecord, view: SiteView, stored: StoredPlan
) -> wire.FloorPlanAnswer:
    components = [c.id for c in view.components]
    placed = await service.floorplans.placements(
        ray_source(service, site, view), site, view, stored, components
    )
    return wire.FloorPlanAnswer(
        site=site.name,
        version=view.version,
        settled=view.settled,
        sha256=stored.sha256,
        lines=len(stored.plan.lines),
        extent=stored.plan.extent,
        components=[_placement(name, found) for name, found in placed.items()],
    )


async def _placed(
    service: Service, site: SiteRecord, view: SiteView, stored: StoredPlan, component: str | None
) -> tuple[str, Pose]:
    """Return the component to compare, and where it lies."""
    components = [c.id for c in view.components if component in (None, c.id)]
    if component is not None and not components:
        raise ProblemError(UNKNOWN_COMPONENT, f"no component {component!r}")
    placed = await service.floorplans.placements(
        ray_source(service, site, view), site, view, stored, components
    )
    known = [(name, p.T_plan_map) for name, p in placed.items() if p.T_plan_map is not None]
    if not known:
        why = "; ".join(f"{name}: {p.reason}" for name, p in placed.items())
        raise ProblemError(NOT_REGISTERED, why or "nothing is mapped yet")
    if len(known) > 1:
        there = ", ".join(name for name, _ in known)
        detail = f"query parameter 'component': several have a place in the plan: {there}"
        raise ProblemError(INVALID_PARAMETER, detail)
    return known[0]


def _placement(component: str, found: Registration) -> wire.Placement:
    best = found.best
    return wire.Placement(
        component=component,
        verdict=found.verdict,
        reason=found.reason,
        T_plan_map=None if found.T_plan_map is None else _pose(found.T_plan_map),
        margin=found.margin,
        share_explained=0.0 if best is None else best.share_explained,
        share_missing=0.0 if best is None else best.share_missing,
        rivals=[_pose(pose) for pose in found.rivals],
    )


def _pose(pose: Pose) -> wire.PoseAnswer:
    return wire.PoseAnswer(x=pose.x, y=pose.y, theta=pose.theta)


def _differences(
    site: SiteRecord, view: SiteView, component: str, found: Differences
) -> wire.PlanDifferences:
    names = [w.id for w in solid_lines(view, component)]
    missing = [wire.PlanPiece(x1=a, y1=b, x2=c, y2=d) for a, b, c, d in found.missing.tolist()]
    new = [
        wire.PlanPiece(x1=a, y1=b, x2=c, y2=d, line=names[of])
        for (a, b, c, d), of in zip(found.new.tolist(), found.new_of.tolist(), strict=True)
    ]
    return wire.PlanDifferences(
        site=site.name,
        version=view.version,
        settled=view.settled,
        component=component,
        missing=missing,
        new=new,
        confirmed_m=float(lengths(found.confirmed).sum()),
        unseen_m=float(lengths(found.unseen).sum()),
    )


def _none(site: SiteRecord) -> ProblemError:
    return ProblemError(NO_FLOOR_PLAN, f"site {site.name!r} has no floor plan; PUT one")
