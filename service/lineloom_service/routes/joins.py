"""An operator says that two places are the same, or that a candidate is right."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from fastapi import APIRouter, Request, Response
from lineloom import wire
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.evidence import JoinTrial
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.mapping.facts.ids import id_of
from lineloom_core.mapping.facts.scan_name import ScanName
from pydantic import ValidationError

from lineloom_service.acting import act_and_follow, unknown
from lineloom_service.answers import answer
from lineloom_service.asking import ask
from lineloom_service.convert import to_constraint
from lineloom_service.convert_evidence import to_join_trial
from lineloom_service.dependencies import CurrentView, KnownSite, ServiceDep, find_robot
from lineloom_service.errors import (
    NOTHING_IN_COMMON,
    RETRACTED,
    UNKNOWN_PLACE,
    UNKNOWN_SCAN,
    ProblemError,
    field_errors,
    invalid_body,
)
from lineloom_service.openapi import body_of
from lineloom_service.request_body import read_body
from lineloom_service.service import Service
from lineloom_service.store.records import SiteRecord

router = APIRouter(tags=["graph"])


@router.post(
    "/v1/sites/{site}/constraints",
    response_model=wire.Constraint,
    status_code=201,
    responses={202: {"model": wire.Constraint}},
    openapi_extra=body_of("JoinRequest"),
)
async def join(
    site: KnownSite, view: CurrentView, request: Request, service: ServiceDep
) -> Response:
    """Say that two places are the same: join their components, or close a loop.

    The matcher measures how they lie; what speaks against it is told in `reason` and refuses
    nothing. 201 with the constraint, of kind `operator`, which is retracted as any other; 202
    where the map takes longer to follow and had it before.
    """
    claim, guessed = await _claim(site, view, request, service)
    found = await _tried(site, service, claim, guessed=guessed)
    if not guessed:
        claim = replace(claim, T_a_b=found.T_a_b)
    return await act_and_follow(service, site, view, claim, "join", done=201)


@router.post(
    "/v1/sites/{site}/constraints/what-if",
    response_model=wire.JoinTrial,
    openapi_extra=body_of("JoinRequest"),
)
async def try_join(
    site: KnownSite, view: CurrentView, request: Request, service: ServiceDep
) -> Response:
    """Tell what saying that two places are the same would come to; changes nothing."""
    claim, guessed = await _claim(site, view, request, service)
    return answer(to_join_trial(await _tried(site, service, claim, guessed=guessed)))


@router.post("/v1/sites/{site}/constraints/{constraint}/confirm", response_model=wire.Constraint)
async def confirm(
    site: KnownSite, constraint: str, view: CurrentView, service: ServiceDep
) -> Response:
    """Believe a candidate, or one that was rejected: from then on its kind is `operator`.

    One that is accepted stays as it is. 409 for one that is retracted: restore that.
    """
    found = next((c for c in view.constraints if c.id == constraint), None)
    if found is None:
        raise unknown(site, constraint)
    if found.state == "retracted":
        raise ProblemError(RETRACTED, f"constraint {constraint!r} is retracted: restore it instead")
    if found.state == "accepted":
        return answer(to_constraint(found))
    claim = replace(found.claim, kind="operator")
    return await act_and_follow(service, site, view, claim, "join")


async def _tried(site: SiteRecord, service: Service, claim: Claim, *, guessed: bool) -> JoinTrial:
    found: JoinTrial | None = await ask(service, site, "try_join", claim, guessed)
    if found is not None:
        return found
    if not guessed and await ask(service, site, "try_join", claim, True) is not None:
        detail = "the two have nothing in common that could be matched; say how they lie, in T_a_b"
        raise ProblemError(NOTHING_IN_COMMON, detail)
    names = ", ".join(
        f"{s.seq} of robot {s.robot!r}, session {s.session!r}" for s in (claim.scan_a, claim.scan_b)
    )
    raise ProblemError(UNKNOWN_SCAN, f"not two places of the map of site {site.name!r}: {names}")


async def _claim(
    site: SiteRecord, view: SiteView, request: Request, service: Service
) -> tuple[Claim, bool]:
    """Return what a body says, and whether it says how the two lie."""
    body = await read_body(request, service.settings)
    try:
        said = wire.JoinRequest.model_validate(body.value)
    except ValidationError as error:
        raise invalid_body(field_errors(error)) from None
    a, b = _end(site, view, said, "a"), _end(site, view, said, "b")
    if a == b:
        reason = "is the same scan as the other"
        raise invalid_body([wire.FieldError(pointer="/seq_b", reason=reason)])
    T = said.T_a_b
    T_a_b = Pose.identity() if T is None else Pose(T.x, T.y, T.theta)
    claim = Claim(id_of("operator", a, b), "operator", "operator", a, b, T_a_b)
    return claim, T is not None


def _end(
    site: SiteRecord, view: SiteView, said: wire.JoinRequest, end: Literal["a", "b"]
) -> ScanName:
    """Return the scan that one end of a join names."""
    robot, place, seq = (getattr(said, f"{what}_{end}") for what in ("robot", "place", "seq"))
    if (robot is None) == (place is None):
        reason = f"name either robot_{end} or place_{end}"
        raise invalid_body([wire.FieldError(pointer=f"/robot_{end}", reason=reason)])
    if robot is None:
        return _anchor(site, view, place)
    find_robot(site, robot)
    if seq is not None:
        return ScanName(robot, getattr(said, f"session_{end}"), seq)
    latest = view.robots.get(robot)
    if latest is None or latest.latest_session is None or latest.latest_seq is None:
        raise ProblemError(UNKNOWN_SCAN, f"no scan of robot {robot!r} is in the map yet")
    return ScanName(robot, latest.latest_session, latest.latest_seq)


def _anchor(site: SiteRecord, view: SiteView, place: str) -> ScanName:
    anchor = next((p.anchor for p in view.places if p.id == place), None)
    keyframe = next((k for k in view.keyframes if k.id == anchor), None)
    if keyframe is None:
        raise ProblemError(UNKNOWN_PLACE, f"no place {place!r} in site {site.name!r}")
    return ScanName(keyframe.robot, keyframe.session, keyframe.seq)
