"""Where a robot has been."""

from __future__ import annotations

import asyncio
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Response
from lineloom import wire
from lineloom_core.io import csv, tum
from lineloom_core.mapping.answers.site_view import TrajectoryView

from lineloom_service.answers import answer, format_choice, unknown_format
from lineloom_service.convert import to_trajectory
from lineloom_service.dependencies import CurrentView, KnownRobot, KnownSite, ServiceDep
from lineloom_service.map_frames import AlignQuery, FrameQuery, in_frame
from lineloom_service.openapi import also_as

router = APIRouter(tags=["robots"])

_NO_SCANS = TrajectoryView(
    session=(),
    seq=np.empty(0, dtype=np.int64),
    stamp=np.empty(0),
    component=(),
    poses=np.empty((0, 3)),
)
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
    view = (await in_frame(service, site, view, align=align, frame=frame)).view
    if format == "json":
        return await asyncio.to_thread(lambda: answer(to_trajectory(robot.name, view)))
    if format not in _TEXT:
        raise unknown_format(format, ("json", *_TEXT))
    write, media_type = _TEXT[format]
    text = await asyncio.to_thread(lambda: write(view.trajectories.get(robot.name, _NO_SCANS)))
    return Response(text, media_type=media_type)
