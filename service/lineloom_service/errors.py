"""Every error as RFC 9457 problem details, with a stable type per kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from lineloom.wire import FieldError, Problem
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from lineloom_service.store.records import BacklogFullError, StorageFullError, StoreError

PROBLEM_JSON = "application/problem+json"

_MAX_FIELD_ERRORS = 100


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of problem. slug: the last part of its `type`, never changed once published."""

    slug: str
    status: int
    title: str


MALFORMED_BODY = Kind("malformed-body", 400, "The body cannot be read")
UNAUTHORIZED = Kind("unauthorized", 401, "A token is needed")
FORBIDDEN = Kind("forbidden", 403, "The token is not good for this")
FOREIGN_ORIGIN = Kind("foreign-origin", 403, "The page is from elsewhere")
NOT_FOUND = Kind("not-found", 404, "There is nothing at this address")
UNKNOWN_SITE = Kind("unknown-site", 404, "There is no such site")
UNKNOWN_ROBOT = Kind("unknown-robot", 404, "There is no such robot")
UNKNOWN_COMPONENT = Kind("unknown-component", 404, "There is no such component")
UNKNOWN_CONSTRAINT = Kind("unknown-constraint", 404, "There is no such constraint")
UNKNOWN_SCAN = Kind("unknown-scan", 404, "There is no such scan in the map")
UNKNOWN_PLACE = Kind("unknown-place", 404, "There is no such place")
UNKNOWN_EXPORT = Kind("unknown-export", 404, "There is no such export")
NEVER_REMADE = Kind("never-remade", 404, "The map was never made anew")
NO_FLOOR_PLAN = Kind("no-floor-plan", 404, "The site has no floor plan")
METHOD_NOT_ALLOWED = Kind("method-not-allowed", 405, "This method is not for this address")
SLOW_BODY = Kind("slow-body", 408, "The body came too slowly")
NOT_CONNECTED = Kind("not-connected", 409, "The two robots' poses are not related")
NOTHING_IN_COMMON = Kind("nothing-in-common", 409, "The two places have nothing in common")
RETRACTED = Kind("retracted", 409, "The constraint is retracted")
NOT_REGISTERED = Kind("not-registered", 409, "The map has no place in the floor plan")
TOO_LARGE = Kind("too-large", 413, "The body is too large")
UNSUPPORTED_TYPE = Kind("unsupported-media-type", 415, "This content type is not understood")
UNSUPPORTED_ENCODING = Kind(
    "unsupported-content-encoding", 415, "This content encoding is not understood"
)
INVALID_BODY = Kind("invalid-body", 422, "The body does not say what it should")
INVALID_PARAMETER = Kind("invalid-parameter", 422, "A parameter is not what it should be")
UNKNOWN_FORMAT = Kind("unknown-format", 422, "This format is not available")
UNKNOWN_HOST = Kind("unknown-host", 421, "The service is not known by this name")
HEAD_TOO_LARGE = Kind("head-too-large", 431, "The head of the request is too large")
BACKLOG_FULL = Kind("backlog-full", 429, "The site has too many scans waiting")
TOO_MANY_REQUESTS = Kind("too-many-requests", 429, "The token asks too much")
INTERNAL = Kind("internal", 500, "The service failed")
NOT_READY = Kind("not-ready", 503, "The service is not ready yet")
TOO_MANY_STREAMS = Kind("too-many-streams", 503, "Too many listeners already")
TOO_MUCH_AT_ONCE = Kind("too-much-at-once", 503, "Too many large bodies at a time")
STORAGE = Kind("storage", 503, "The storage failed")
STORAGE_FULL = Kind("storage-full", 507, "The storage is full")
_OTHER = Kind("http", 400, "The request was refused")

KINDS = tuple(value for value in list(globals().values()) if isinstance(value, Kind))


class ProblemError(Exception):
    """Raised anywhere below a route; answered as a problem."""

    def __init__(
        self,
        kind: Kind,
        detail: str,
        *,
        errors: Sequence[FieldError] = (),
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.kind = kind
        self.detail = detail
        self.errors = errors
        self.headers = headers


def problem_response(
    kind: Kind,
    detail: str,
    *,
    status: int | None = None,
    errors: Sequence[FieldError] = (),
    headers: Mapping[str, str] | None = None,
) -> Response:
    """Return the answer that tells of a problem."""
    problem = Problem(
        type=f"/problems/{kind.slug}",
        title=kind.title,
        status=status or kind.status,
        detail=detail,
        errors=list(errors[:_MAX_FIELD_ERRORS]),
    )
    return Response(
        problem.model_dump_json(),
        status_code=problem.status,
        headers=dict(headers or {}),
        media_type=PROBLEM_JSON,
    )


def invalid_body(errors: Sequence[FieldError]) -> ProblemError:
    """Return the 422 for a body with these faults."""
    first = errors[0]
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    where = first.pointer or "the body"
    return ProblemError(INVALID_BODY, f"{where}: {first.reason}{more}", errors=errors)


def field_errors(error: ValidationError, prefix: str = "") -> list[FieldError]:
    """Return what pydantic found, by JSON pointer."""
    return [
        FieldError(pointer=prefix + pointer(*fault["loc"]), reason=fault["msg"])
        for fault in error.errors(include_url=False, include_context=False, include_input=False)
    ]


def pointer(*parts: str | int) -> str:
    """Return a JSON pointer (RFC 6901) to a place in the body."""
    return "".join("/" + str(part).replace("~", "~0").replace("/", "~1") for part in parts)


def install(app: FastAPI, allowed_methods: Callable[[str], Sequence[str]]) -> None:
    """Answer every error as a problem. allowed_methods: those of an address."""

    @app.exception_handler(ProblemError)
    async def _problem(request: Request, error: ProblemError) -> Response:
        return _counted(
            request, error.kind, error.detail, errors=error.errors, headers=error.headers
        )

    @app.exception_handler(RequestValidationError)
    async def _parameter(request: Request, error: RequestValidationError) -> Response:
        # Once each: several dependencies may ask for the same parameter.
        faults = {_describe_parameter(fault["loc"], fault["msg"]): 0 for fault in error.errors()}
        return _counted(request, INVALID_PARAMETER, "; ".join(faults))

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> Response:
        path, method = request.url.path, request.method
        if error.status_code == NOT_FOUND.status:
            return _counted(request, NOT_FOUND, f"{path} is not an address of this service")
        if error.status_code == METHOD_NOT_ALLOWED.status:
            detail = f"{path} does not answer {method}"
            return _counted(
                request,
                METHOD_NOT_ALLOWED,
                detail,
                headers={"Allow": ", ".join(allowed_methods(path))},
            )
        return _counted(
            request, _OTHER, str(error.detail), status=error.status_code, headers=error.headers
        )

    @app.exception_handler(ClientDisconnect)
    async def _gone(request: Request, _: ClientDisconnect) -> Response:
        # For the figures and the log: nobody is there to read it.
        return _counted(request, MALFORMED_BODY, "the connection ended in the middle of the body")

    @app.exception_handler(BacklogFullError)
    async def _backlog(request: Request, error: BacklogFullError) -> Response:
        detail = f"{error}; nothing of this request was taken, send it again later"
        return _counted(request, BACKLOG_FULL, detail, headers={"Retry-After": "2"})

    @app.exception_handler(StorageFullError)
    async def _full(request: Request, error: StorageFullError) -> Response:
        return _counted(request, STORAGE_FULL, str(error), headers={"Retry-After": "30"})

    @app.exception_handler(StoreError)
    async def _storage(request: Request, error: StoreError) -> Response:
        return _counted(request, STORAGE, str(error), headers={"Retry-After": "5"})


def internal_problem() -> Response:
    """Return the answer to whatever nobody foresaw; the log has the rest."""
    return problem_response(INTERNAL, "an unexpected error; the service's log has the details")


def _counted(request: Request, kind: Kind, detail: str, **more: Any) -> Response:
    request.app.state.service.metrics.count_problem(kind.slug)
    return problem_response(kind, detail, **more)


def _describe_parameter(loc: Sequence[str | int], message: str) -> str:
    where, name = str(loc[0]), str(loc[-1])
    return f"{where} parameter {name!r}: {message}"
