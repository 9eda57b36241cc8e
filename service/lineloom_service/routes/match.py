"""A stateless pairwise match."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from lineloom import wire
from lineloom.wire.scan import STRICT_JSON
from lineloom_core.scan import InvalidScanError, Scan
from pydantic import ValidationError

from lineloom_service.answers import answer
from lineloom_service.convert import to_match, to_scan
from lineloom_service.dependencies import ServiceDep
from lineloom_service.errors import field_errors, invalid_body, pointer
from lineloom_service.openapi import body_of
from lineloom_service.request_body import read_body

router = APIRouter(tags=["match"])


@router.post("/v1/match", response_model=wire.MatchAnswer, openapi_extra=body_of("MatchRequest"))
async def post_match(request: Request, service: ServiceDep) -> Response:
    """Find where `current` was taken, seen from `reference`, without any guess."""
    body = await read_body(request, service.settings)
    try:
        pair = wire.MatchRequest.model_validate(
            body.value, context=STRICT_JSON if body.is_json else None
        )
    except ValidationError as error:
        raise invalid_body(field_errors(error)) from None
    reference = _checked("reference", pair.reference)
    current = _checked("current", pair.current)
    return answer(to_match(await service.matcher.match(reference, current)))


def _checked(which: str, scan: wire.MatchScan) -> Scan:
    try:
        return to_scan(scan)
    except InvalidScanError as error:
        fault = wire.FieldError(pointer=pointer(which, error.field), reason=error.reason)
        raise invalid_body([fault]) from None
