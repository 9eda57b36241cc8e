"""Where one robot is, seen from another."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Response
from lineloom import wire
from lineloom.wire import ID_PATTERN

from lineloom_service.answers import answer
from lineloom_service.convert import to_transform
from lineloom_service.dependencies import CurrentView, KnownSite, find_robot
from lineloom_service.errors import NOT_CONNECTED, ProblemError
from lineloom_service.relative_pose import NotConnectedError, relative_pose

router = APIRouter(tags=["robots"])

_RobotName = Annotated[str, Path(pattern=ID_PATTERN)]


@router.get("/v1/sites/{site}/transforms/{robot_a}/{robot_b}", response_model=wire.Transform)
async def get_transform(
    site: KnownSite, robot_a: _RobotName, robot_b: _RobotName, view: CurrentView
) -> Response:
    """Return T_a_b, the pose of robot_b in robot_a's frame, both at their latest scans."""
    for robot in (robot_a, robot_b):
        find_robot(site, robot)
    try:
        found = relative_pose(view, robot_a, robot_b)
    except NotConnectedError as error:
        raise ProblemError(NOT_CONNECTED, str(error)) from None
    return answer(to_transform(robot_a, robot_b, view, found))
