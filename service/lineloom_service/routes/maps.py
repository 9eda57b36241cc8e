"""The fused line map."""

from __future__ import annotations

import json
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response
from lineloom import wire
from lineloom.wire.base import MAX_COUNTER
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.answers import (
    JSON,
    IfNoneMatch,
    answer,
    format_choice,
    matches,
    unknown_format,
)
from lineloom_service.dependencies import CurrentView, KnownSite, ServiceDep
from lineloom_service.errors import INVALID_PARAMETER, UNKNOWN_COMPONENT, ProblemError
from lineloom_service.map_files import read_bbox, read_layers, render_map
from lineloom_service.map_frames import AlignQuery, FrameQuery, in_frame, versioned
from lineloom_service.maps.map_store import MapPart
from lineloom_service.openapi import NOT_MODIFIED, also_as

router = APIRouter(tags=["map"])


@router.get(
    "/v1/sites/{site}/map",
    response_model=wire.MapAnswer,
    responses={
        **also_as(
            *(format.media_type for name, format in wire.MAP_FORMATS.items() if name != "json")
        ),
        **NOT_MODIFIED,
        307: {"description": "The component was merged; Location is the survivor's map."},
    },
)
async def get_map(
    request: Request,
    site: KnownSite,
    view: CurrentView,
    service: ServiceDep,
    format: Annotated[str, format_choice(wire.MAP_FORMATS)] = "json",
    component: Annotated[str | None, Query(description="Only this component.")] = None,
    bbox: Annotated[str | None, Query(description="x_min,y_min,x_max,y_max in metres.")] = None,
    align: AlignQuery = False,
    frame: FrameQuery = "map",
    resolution: Annotated[
        float | None, Query(gt=0.0, le=10.0, description="Metres a cell, for nav2.")
    ] = None,
    layers: Annotated[
        str | None,
        Query(description="Of wall, furniture, clutter; all but clutter if left out."),
    ] = None,
    since: Annotated[
        int | None,
        Query(ge=0, le=MAX_COUNTER, description="A `version`: only what has changed after it."),
    ] = None,
    since_settled: Annotated[
        bool, Query(description="That version's answer said `settled`.")
    ] = False,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Return the map in one of the formats that `/v1/map-formats` lists.

    With `since` (json only) only what changed after that version: lines that are new or not what
    they were, and ids that are gone; `full` says that the version is not known (any more) and that
    the answer is the whole map. A version is shown unsettled first: say by `since_settled` what its
    `settled` was, else what moved as it settled is told again.
    """
    if format not in wire.MAP_FORMATS:
        raise unknown_format(format, wire.MAP_FORMATS)
    plain = format == "json" and frame == "map" and not align
    if since is not None and not plain:
        detail = "query parameter 'since': goes with format=json in the map's own frame only"
        raise ProblemError(INVALID_PARAMETER, detail)
    box, chosen = read_bbox(bbox), read_layers(layers)
    if component is not None and all(c.id != component for c in view.components):
        return _elsewhere(request, view, component)
    headers = await versioned(service, site, view, frame)
    if matches(if_none_match, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    if plain:
        part = MapPart(component, box, since, since_settled, chosen)
        content = await service.maps.json(site, view, part)
    else:
        shown = await in_frame(service, site, view, align=align, frame=frame, component=component)
        content = await render_map(service, site, shown, format, component, box, resolution, chosen)
    return Response(content, headers=headers, media_type=wire.MAP_FORMATS[format].media_type)


@router.get("/v1/map-formats", response_model=wire.MapFormatList)
async def get_map_formats() -> Response:
    """Return the formats that a map can be had in, by name."""
    return answer(wire.MapFormatList(formats=dict(wire.MAP_FORMATS)))


def _elsewhere(request: Request, view: SiteView, component: str) -> Response:
    """Point to the component that has absorbed this one, or say that there never was one."""
    survivor = view.merged_into.get(component)
    if survivor is None:
        known = ", ".join(c.id for c in view.components) or "none"
        raise ProblemError(UNKNOWN_COMPONENT, f"no component {component!r}; there is: {known}")
    while survivor in view.merged_into:
        survivor = view.merged_into[survivor]
    query = {**request.query_params, "component": survivor}
    return Response(
        json.dumps({"component": component, "merged_into": survivor}),
        status_code=307,
        headers={"Location": f"{request.url.path}?{urlencode(query)}"},
        media_type=JSON,
    )
