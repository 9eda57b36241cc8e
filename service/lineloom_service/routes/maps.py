"""The fused line map."""

from __future__ import annotations

import json
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Header, Query, Request, Response
from lineloom import wire
from lineloom.wire.base import MAX_COUNTER
from lineloom_core.io import geojson, png, svg
from lineloom_core.io.selection import BBox, check_bbox
from lineloom_core.mapping.site_view import SiteView

from lineloom_service import __version__
from lineloom_service.answers import JSON, matches, unknown_format
from lineloom_service.dependencies import CurrentView, KnownSite, ServiceDep
from lineloom_service.errors import INVALID_PARAMETER, UNKNOWN_COMPONENT, ProblemError
from lineloom_service.openapi import also_as

router = APIRouter(tags=["map"])

MEDIA_TYPES = {
    "json": JSON,
    "geojson": "application/geo+json",
    "svg": "image/svg+xml",
    "png": "image/png",
}


@router.get(
    "/v1/sites/{site}/map",
    response_model=wire.MapAnswer,
    responses={
        **also_as("application/geo+json", "image/svg+xml", "image/png"),
        304: {"description": "The copy that If-None-Match names is current."},
        307: {"description": "The component was merged; Location is the survivor's map."},
    },
)
async def get_map(
    request: Request,
    site: KnownSite,
    view: CurrentView,
    service: ServiceDep,
    format: str = "json",
    component: Annotated[str | None, Query(description="Only this component.")] = None,
    bbox: Annotated[str | None, Query(description="x_min,y_min,x_max,y_max in metres.")] = None,
    since: Annotated[
        int | None,
        Query(ge=0, le=MAX_COUNTER, description="A `version`: only what has changed after it."),
    ] = None,
    if_none_match: Annotated[str | None, Header()] = None,
) -> Response:
    """Return the map: `format` is json, geojson, svg or png.

    With `since` (json only) only what changed after that version: lines that are new or not what
    they were, and ids that are gone; `full` says that the version is not known (any more) and that
    the answer is the whole map.
    """
    if format not in MEDIA_TYPES:
        raise unknown_format(format, MEDIA_TYPES)
    if since is not None and format != "json":
        raise ProblemError(INVALID_PARAMETER, "query parameter 'since': goes with format=json only")
    box = _read_bbox(bbox)
    if component is not None and all(c.id != component for c in view.components):
        return _elsewhere(request, view, component)
    etag = f'"{site.id}-{view.version}-{__version__}"'
    headers = {"ETag": etag, "Cache-Control": "no-cache"}
    if matches(if_none_match, etag):
        return Response(status_code=304, headers=headers)
    if format == "json":
        content = await service.maps.json(site, view, component, box, since)
    else:
        content = await service.maps.other(
            site, view, (format, component, box), lambda: _render(view, format, component, box)
        )
    return Response(content, headers=headers, media_type=MEDIA_TYPES[format])


def _render(view: SiteView, format: str, component: str | None, box: BBox | None) -> str | bytes:
    if format == "geojson":
        return json.dumps(geojson.map_features(view, component, box), separators=(",", ":"))
    if format == "svg":
        return svg.render_map(view, component, box)
    return png.render_map(view, component, box)


def _read_bbox(text: str | None) -> BBox | None:
    if text is None:
        return None
    try:
        x_min, y_min, x_max, y_max = (float(part) for part in text.split(","))
        box = (x_min, y_min, x_max, y_max)
        check_bbox(box)
    except ValueError:
        detail = "query parameter 'bbox': must be x_min,y_min,x_max,y_max with min < max"
        raise ProblemError(INVALID_PARAMETER, detail) from None
    return box


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
