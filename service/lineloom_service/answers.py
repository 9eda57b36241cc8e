"""How answers are written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated

from fastapi import Header, Query, Response
from fastapi.params import Query as QueryInfo
from pydantic import BaseModel

from lineloom_service.errors import UNKNOWN_FORMAT, ProblemError

JSON = "application/json"

IfNoneMatch = Annotated[str | None, Header(description="`ETag` of the copy that is there.")]


def answer(
    model: BaseModel, *, status: int = 200, headers: Mapping[str, str] | None = None
) -> Response:
    """Return a model as JSON, straight from pydantic's serialiser."""
    return Response(
        model.model_dump_json(), status_code=status, headers=dict(headers or {}), media_type=JSON
    )


def format_choice(available: Iterable[str]) -> QueryInfo:
    """Return the description of a query parameter `format`; the route itself checks it."""
    query: QueryInfo = Query(
        description="How the answer is written.", json_schema_extra={"enum": list(available)}
    )
    return query


def unknown_format(wanted: str, available: Iterable[str]) -> ProblemError:
    """Return the problem for a format that there is not."""
    return ProblemError(
        UNKNOWN_FORMAT, f"no format {wanted!r}; available are {', '.join(available)}"
    )


def matches(if_none_match: str | None, etag: str) -> bool:
    """Tell whether the client's copy is current (RFC 9110, weak comparison)."""
    if if_none_match is None:
        return False
    candidates = [tag.strip().removeprefix("W/") for tag in if_none_match.split(",")]
    return "*" in candidates or etag.removeprefix("W/") in candidates
