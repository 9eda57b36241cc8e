"""Whether the service is alive, and whether it can take scans."""

from __future__ import annotations

from lineloom.wire.base import Answer


class Health(Answer):
    """The process answers."""

    status: str
    version: str


class Readiness(Answer):
    """`ready` means scans are taken and mapped; otherwise `reasons` says what is missing."""

    ready: bool
    reasons: list[str]
