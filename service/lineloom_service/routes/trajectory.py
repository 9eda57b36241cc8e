"""Where a robot has been."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Response
from lineloom import wire
from lineloom_core.io import csv, tum
from lineloom_core.mapping.answers import Trajectory

from lineloom_service.answers import answer, format_choice, unknown_format
from lineloom_service.asking import ask
from lineloom_service.convert import to_trajectory
from lineloom_service.dependencies import CurrentView, KnownRobot, KnownSite, ServiceDep
from lineloom_service.map_frames import AlignQuery, FrameQuery, in_frame
from lineloom_service.openapi import also_as

router = APIRouter(tags=["robots"])

_TEXT = {
    "tum": (tum.write_trajectory, "text/plain"),
    "csv": (csv.write_trajectory, "text/csv"),
}


@router.get(
    "/v1/sites/{site}/robots/{robot}/trajectory",
    response_model=wire.Trajectory,
    responses=also_as("text/plain", "text/csv"),
)
async def get_trajectory(
    site: KnownSite,
    robot: KnownRobot,
    view: CurrentView,
    service: ServiceDep,
    format: Annotated[str, format_choice(("json", *_TEXT))] = "json",
    align: AlignQuery = False,
    frame: FrameQuery = "map",
) -> Response:
    """Return the pose of every processed scan: `format` is json, tum or csv.

    A scan that fitted nowhere has a row without component and pose; tum leaves it out.

    In the floor plan's frame: of scans in components that have a place there.
    """
    if format not in ("json", *_TEXT):
        raise unknown_format(format, ("json", *_TEXT))
    found: Trajectory = await ask(service, site, "trajectory", robot.name)
    view = replace(view, trajectories={robot.name: found.scans})
    framed = (await in_frame(service, site, view, align=align, frame=frame)).view
    scans = framed.trajectories[robot.name]
    if format == "json":
        written = await asyncio.to_thread(to_trajectory, robot.name, found.version, scans)
        return answer(written)
    write, media_type = _TEXT[format]
    text = await asyncio.to_thread(write, scans)
    return Response(text, media_type=media_type)
