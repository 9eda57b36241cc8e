"""Doing what an operator says of a constraint, and waiting until the map has followed."""

from __future__ import annotations

from fastapi import Response
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.belief.claim import Claim

from lineloom_service.answers import answer
from lineloom_service.convert import to_constraint
from lineloom_service.errors import NOT_READY, UNKNOWN_CONSTRAINT, ProblemError
from lineloom_service.service import Service
from lineloom_service.store.actions import act
from lineloom_service.store.codec import encode_claim
from lineloom_service.store.records import ActionKind, SiteRecord

_FOLLOW_S = 20.0
"""How long an action's answer waits for the map."""


async def act_and_follow(
    service: Service,
    site: SiteRecord,
    view: SiteView,
    claim: Claim,
    action: ActionKind,
    *,
    done: int = 200,
) -> Response:
    """Log an action, wait until the map has followed it, and return the constraint then.

    With status `done`, or 202 and the constraint as it still is where the map takes longer.
    """
    body, robot = encode_claim(claim), claim.scan_b.robot
    position = await service.store.write(act, site.name, robot, action, body)
    if position is None:
        raise unknown(site, claim.constraint)
    followed = await service.conductor.reached(site.id, position, _FOLLOW_S)
    now = service.conductor.published(site.id).view
    for known in (now, view):
        for c in known.constraints:
            if c.id == claim.constraint:
                return answer(to_constraint(c), status=done if followed else 202)
    detail = f"it is logged and will hold, but the map of site {site.name!r} takes longer to follow"
    raise ProblemError(NOT_READY, detail, headers={"Retry-After": "5"})


def unknown(site: SiteRecord, name: str) -> ProblemError:
    """Return the problem that there is no constraint of this name."""
    return ProblemError(UNKNOWN_CONSTRAINT, f"no constraint {name!r} in site {site.name!r}")
