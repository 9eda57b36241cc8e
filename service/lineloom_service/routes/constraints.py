"""Constraints and their evidence."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter, Query, Response
from lineloom import wire
from lineloom.wire.constraint import ConstraintKind, ConstraintState
from lineloom_core.io.evidence_drawing import draw_evidence
from lineloom_core.io.svg import to_svg
from lineloom_core.mapping.answers.evidence import Evidence, WhatIf
from lineloom_core.mapping.answers.site_view import ConstraintView, SiteView

from lineloom_service.acting import act_and_follow, unknown
from lineloom_service.answers import (
    JSON,
    IfNoneMatch,
    answer,
    format_choice,
    matches,
    unknown_format,
)
from lineloom_service.asking import ask
from lineloom_service.convert import to_constraint
from lineloom_service.convert_evidence import to_detail, to_what_if
from lineloom_service.dependencies import CurrentView, KnownSite, ServiceDep
from lineloom_service.errors import INVALID_PARAMETER, ProblemError
from lineloom_service.map_frames import versioned
from lineloom_service.openapi import NOT_MODIFIED, also_as
from lineloom_service.store.records import SiteRecord

_FORMATS = ("json", "svg")

router = APIRouter(tags=["graph"])


@router.get(
    "/v1/sites/{site}/constraints", response_model=wire.ConstraintPage, responses=NOT_MODIFIED
)
async def list_constraints(
    site: KnownSite,
    view: CurrentView,
    service: ServiceDep,
    kind: ConstraintKind | None = None,
    state: ConstraintState | None = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
    cursor: Annotated[str | None, Query(description="`next_cursor` of the page before.")] = None,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Return constraints, a page at a time."""
    rest = _after(view, cursor)
    headers = await versioned(service, site, view)
    if matches(if_none_match, headers["ETag"]):
        return Response(status_code=304, headers=headers)

    def render() -> str:
        found = [c for c in rest if kind in (None, c.kind) and state in (None, c.state)]
        return _page(site.name, view, found, limit).model_dump_json()

    form = ("constraints", kind, state, limit, cursor)
    content = await service.maps.other(site, view, form, render)
    return Response(content, headers=headers, media_type=JSON)


@router.get(
    "/v1/sites/{site}/constraints/{constraint}",
    response_model=wire.ConstraintDetail,
    responses=also_as("image/svg+xml"),
)
async def get_constraint(
    site: KnownSite,
    constraint: str,
    view: CurrentView,
    service: ServiceDep,
    format: Annotated[str, format_choice(_FORMATS)] = "json",
) -> Response:
    """Return one constraint with its evidence: `format` is json or svg."""
    if format not in _FORMATS:
        raise unknown_format(format, _FORMATS)
    found = _find(site, view, constraint)
    try:
        evidence: Evidence | None = await ask(service, site, "explain", constraint)
    except ProblemError:
        if format == "svg":
            raise
        evidence = None  # what is known without the mapper is worth an answer
    if format == "json":
        return answer(to_detail(found, evidence))
    if evidence is None:
        raise unknown(site, constraint)
    drawing = await asyncio.to_thread(draw_evidence, found, evidence)
    return Response(to_svg(drawing), media_type="image/svg+xml")


@router.post("/v1/sites/{site}/constraints/{constraint}/retract", response_model=wire.Constraint)
async def retract_constraint(
    site: KnownSite, constraint: str, view: CurrentView, service: ServiceDep
) -> Response:
    """Make the map as if the constraint had never been accepted, for good.

    Of a recognised meeting, all that says the same is refused with it. 200 with the constraint in
    its new state; 202 with it as it still is, where the map takes longer to follow.
    """
    claim = _find(site, view, constraint).claim
    return await act_and_follow(service, site, view, claim, "retract")


@router.post("/v1/sites/{site}/constraints/{constraint}/restore", response_model=wire.Constraint)
async def restore_constraint(
    site: KnownSite, constraint: str, view: CurrentView, service: ServiceDep
) -> Response:
    """Take a retraction back, or overrule what the mapper has withdrawn."""
    claim = _find(site, view, constraint).claim
    return await act_and_follow(service, site, view, claim, "restore")


@router.post("/v1/sites/{site}/constraints/{constraint}/what-if", response_model=wire.WhatIf)
async def what_if(
    site: KnownSite, constraint: str, view: CurrentView, service: ServiceDep
) -> Response:
    """Tell what retracting the constraint (restoring, where it is retracted) would do."""
    _find(site, view, constraint)
    found: WhatIf | None = await ask(service, site, "what_if", constraint)
    if found is None:
        raise unknown(site, constraint)
    return answer(to_what_if(found, view.version))


def _find(site: SiteRecord, view: SiteView, name: str) -> ConstraintView:
    for found in view.constraints:
        if found.id == name:
            return found
    raise unknown(site, name)


def _after(view: SiteView, cursor: str | None) -> tuple[ConstraintView, ...]:
    """Return the constraints behind the one that the cursor names: they only ever grow."""
    if cursor is None:
        return view.constraints
    for index, constraint in enumerate(view.constraints):
        if constraint.id == cursor:
            return view.constraints[index + 1 :]
    raise ProblemError(INVALID_PARAMETER, "query parameter 'cursor': names no page (any more)")


def _page(
    site: str, view: SiteView, found: Sequence[ConstraintView], limit: int
) -> wire.ConstraintPage:
    page = found[:limit]
    return wire.ConstraintPage(
        site=site,
        version=view.version,
        settled=view.settled,
        constraints=[to_constraint(constraint) for constraint in page],
        next_cursor=page[-1].id if len(found) > limit else None,
    )
