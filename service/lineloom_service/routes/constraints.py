"""Constraints and their evidence."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response
from lineloom import wire
from lineloom.wire.constraint import ConstraintKind, ConstraintState
from lineloom_core.mapping.site_view import ConstraintView, SiteView

from lineloom_service.answers import answer
from lineloom_service.convert import to_constraint
from lineloom_service.dependencies import CurrentView, KnownSite
from lineloom_service.errors import INVALID_PARAMETER, UNKNOWN_CONSTRAINT, ProblemError

router = APIRouter(tags=["graph"])


@router.get("/v1/sites/{site}/constraints", response_model=wire.ConstraintPage)
async def list_constraints(
    site: KnownSite,
    view: CurrentView,
    kind: ConstraintKind | None = None,
    state: ConstraintState | None = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
    cursor: Annotated[str | None, Query(description="`next_cursor` of the page before.")] = None,
) -> Response:
    """Return constraints, a page at a time."""
    found = [
        constraint
        for constraint in _after(view, cursor)
        if kind in (None, constraint.kind) and state in (None, constraint.state)
    ]
    page = found[:limit]
    robots = _robots(view)
    return answer(
        wire.ConstraintPage(
            site=site.name,
            version=view.version,
            constraints=[to_constraint(constraint, robots) for constraint in page],
            next_cursor=page[-1].id if len(found) > limit else None,
        )
    )


@router.get("/v1/sites/{site}/constraints/{constraint}", response_model=wire.Constraint)
async def get_constraint(site: KnownSite, constraint: str, view: CurrentView) -> Response:
    """Return one constraint with its evidence."""
    for found in view.constraints:
        if found.id == constraint:
            return answer(to_constraint(found, _robots(view)))
    detail = f"no constraint {constraint!r} in site {site.name!r}"
    raise ProblemError(UNKNOWN_CONSTRAINT, detail)


def _after(view: SiteView, cursor: str | None) -> tuple[ConstraintView, ...]:
    """Return the constraints behind the one that the cursor names: they only ever grow."""
    if cursor is None:
        return view.constraints
    for index, constraint in enumerate(view.constraints):
        if constraint.id == cursor:
            return view.constraints[index + 1 :]
    raise ProblemError(INVALID_PARAMETER, "query parameter 'cursor': names no page (any more)")


def _robots(view: SiteView) -> dict[int, str]:
    return {keyframe.id: keyframe.robot for keyframe in view.keyframes}
