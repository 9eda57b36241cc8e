"""The pose graph."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from lineloom import wire
from lineloom_core.io import g2o
from lineloom_core.mapping.answers.site_view import SiteView

from lineloom_service.answers import JSON, IfNoneMatch, format_choice, matches, unknown_format
from lineloom_service.convert import to_graph
from lineloom_service.dependencies import CurrentView, KnownSite, ServiceDep
from lineloom_service.map_frames import AlignQuery, FrameQuery, in_frame, versioned
from lineloom_service.openapi import NOT_MODIFIED, also_as

FORMATS = {"json": JSON, "g2o": "text/plain"}

router = APIRouter(tags=["graph"])


@router.get(
    "/v1/sites/{site}/graph",
    response_model=wire.Graph,
    responses={**also_as("text/plain"), **NOT_MODIFIED},
)
async def get_graph(
    site: KnownSite,
    view: CurrentView,
    service: ServiceDep,
    format: Annotated[str, format_choice(FORMATS)] = "json",
    align: AlignQuery = False,
    frame: FrameQuery = "map",
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Return keyframes and accepted constraints: `format` is json (node-link) or g2o.

    In the floor plan's frame: those of components that have a place there.
    """
    if format not in FORMATS:
        raise unknown_format(format, FORMATS)
    headers = await versioned(service, site, view, frame)
    if matches(if_none_match, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    shown = await in_frame(service, site, view, align=align, frame=frame)
    form = ("graph", format, shown.key)
    content = await service.maps.other(
        site, shown.view, form, lambda: _render(site.name, shown.view, format)
    )
    return Response(content, headers=headers, media_type=FORMATS[format])


def _render(site: str, view: SiteView, format: str) -> str:
    return g2o.write_graph(view) if format == "g2o" else to_graph(site, view).model_dump_json()
