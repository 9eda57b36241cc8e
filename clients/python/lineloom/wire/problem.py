"""RFC 9457 problem details: how every error is told."""

from __future__ import annotations

from pydantic import Field

from lineloom.wire.base import Answer


class FieldError(Answer):
    """What is wrong at one place of the body; `pointer` is a JSON pointer (RFC 6901)."""

    pointer: str
    reason: str


class Problem(Answer):
    """An error. `type` is stable and names the kind, e.g. `/problems/not-connected`."""

    type: str
    title: str
    status: int
    detail: str
    errors: list[FieldError] = Field(default_factory=list)
