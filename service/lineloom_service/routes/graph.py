"""The pose graph."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, Response
from lineloom import wire
from lineloom_core.io import g2o
from lineloom_core.mapping.answers.factor_graph import FactorGraph

from lineloom_service.answers import JSON, IfNoneMatch, format_choice, matches, unknown_format
from lineloom_service.asking import ask
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

    In the floor plan's frame: those of components that have a place there. g2o is written from
    gtsam's own factors and values, settled however busy the site is.
    """
    if format not in FORMATS:
        raise unknown_format(format, FORMATS)
    headers = await versioned(service, site, view, frame)
    if matches(if_none_match, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    shown = await in_frame(service, site, view, align=align, frame=frame)
    if format == "g2o":
        graph: FactorGraph = await ask(service, site, "factors")
        frames = None if frame == "map" and not align else shown.frames
        text = await asyncio.to_thread(g2o.write_graph, graph, frames)
        if (
            graph.version != view.version or not view.settled
        ):  # it is not of the view that was named
            del headers["ETag"]
        return Response(text, headers=headers, media_type=FORMATS[format])
    content = await service.maps.other(
        site,
        shown.view,
        ("graph", format, shown.key),
        lambda: to_graph(site.name, shown.view).model_dump_json(),
    )
    return Response(content, headers=headers, media_type=FORMATS[format])
