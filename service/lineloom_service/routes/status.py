"""Alive, and ready."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response
from lineloom import wire

from lineloom_service import __version__
from lineloom_service.answers import answer
from lineloom_service.dependencies import ServiceDep
from lineloom_service.errors import NOT_READY, PROBLEM_JSON

router = APIRouter(tags=["status"])


_MAPS = "503 until workers are warm and every site's map is as far as before, too."


class _NotReady(wire.Problem, wire.Readiness):
    """A problem that readers of Readiness understand as well."""


@router.get("/healthz", response_model=wire.Health)
async def healthz() -> Response:
    """The process answers."""
    return answer(wire.Health(status="ok", version=__version__))


@router.get("/readyz", response_model=wire.Readiness)
async def readyz(
    service: ServiceDep, maps: Annotated[bool, Query(description=_MAPS)] = False
) -> Response:
    """Scans are taken, and with `maps=true` mapped as well; 503 says what is missing."""
    await service.look_at_storage()
    state = service.readiness()
    if state.takes_scans and (state.maps or not maps):
        return answer(state)
    problem = _NotReady(
        type=f"/problems/{NOT_READY.slug}",
        title=NOT_READY.title,
        status=NOT_READY.status,
        detail="; ".join(state.reasons),
        **state.model_dump(),
    )
    return Response(
        problem.model_dump_json(),
        status_code=problem.status,
        media_type=PROBLEM_JSON,
        headers={"Retry-After": "1"},
    )
