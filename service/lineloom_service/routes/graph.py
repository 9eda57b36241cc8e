"""The pose graph."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, Response
from lineloom import wire
from lineloom_core.io import g2o

from lineloom_service.answers import answer, format_choice, unknown_format
from lineloom_service.convert import to_graph
from lineloom_service.dependencies import CurrentView, KnownSite, ServiceDep
from lineloom_service.map_frames import AlignQuery, FrameQuery, in_frame
from lineloom_service.openapi import also_as

FORMATS = ("json", "g2o")

router = APIRouter(tags=["graph"])


@router.get("/v1/sites/{site}/graph", response_model=wire.Graph, responses=also_as("text/plain"))
async def get_graph(
    site: KnownSite,
    view: CurrentView,
    service: ServiceDep,
    format: Annotated[str, format_choice(FORMATS)] = "json",
    align: AlignQuery = False,
    frame: FrameQuery = "map",
) -> Response:
    """Return keyframes and accepted constraints: `format` is json (node-link) or g2o.

    In the floor plan's frame: those of components that have a place there.
    """
    view = (await in_frame(service, site, view, align=align, frame=frame)).view
    if format == "json":
        return answer(await asyncio.to_thread(to_graph, site.name, view))
    if format == "g2o":
        return Response(await asyncio.to_thread(g2o.write_graph, view), media_type="text/plain")
    raise unknown_format(format, FORMATS)
