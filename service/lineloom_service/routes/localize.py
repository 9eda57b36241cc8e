"""Where a scan was taken: asked of a site's map, which does not change by it."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response
from lineloom import wire
from lineloom.wire.scan import STRICT_JSON
from lineloom_core.mapping.answers.localisation import Localisation
from lineloom_core.scan import InvalidScanError, Scan
from pydantic import ValidationError

from lineloom_service.answers import answer
from lineloom_service.asking import ask
from lineloom_service.convert import to_scan
from lineloom_service.convert_evidence import to_localization
from lineloom_service.dependencies import KnownSite, ServiceDep
from lineloom_service.errors import field_errors, invalid_body, pointer
from lineloom_service.openapi import body_of
from lineloom_service.request_body import Body, read_body

router = APIRouter(tags=["match"])


@router.post(
    "/v1/sites/{site}/localize",
    response_model=wire.LocalizeAnswer,
    openapi_extra=body_of("MatchScan", "LocalizeRequest"),
)
async def post_localize(site: KnownSite, request: Request, service: ServiceDep) -> Response:
    """Tell where one scan, or the latest of `{"scans": [...]}`, was taken; adds nothing."""
    scans = _checked(await read_body(request, service.settings))
    found: Localisation = await ask(service, site, "localise", scans)
    return answer(to_localization(site.name, found))


def _checked(body: Body) -> list[Scan]:
    """The scans of a body. Raises ProblemError (422) pointing at all that is wrong with them."""
    many = isinstance(body.value, dict) and "scans" in body.value
    value: Any = body.value if many else {"scans": [body.value]}
    try:
        run = wire.LocalizeRequest.model_validate(
            value, context=STRICT_JSON if body.is_json else None
        )
    except ValidationError as error:
        raise invalid_body([_placed(fault, many) for fault in field_errors(error)]) from None
    scans: list[Scan] = []
    faults: list[wire.FieldError] = []
    for index, scan in enumerate(run.scans):
        try:
            scans.append(to_scan(scan))
        except InvalidScanError as error:
            at = pointer("scans", index, error.field)
            faults.append(_placed(wire.FieldError(pointer=at, reason=error.reason), many))
    if faults:
        raise invalid_body(faults)
    return scans


def _placed(fault: wire.FieldError, many: bool) -> wire.FieldError:
    """The same, pointing into the body as it was sent."""
    if many:
        return fault
    return wire.FieldError(pointer=fault.pointer.removeprefix("/scans/0"), reason=fault.reason)
