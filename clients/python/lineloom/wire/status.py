"""Whether the service is alive, and whether it can take scans."""

from __future__ import annotations

from lineloom.wire.base import Answer


class Health(Answer):
    """The process answers."""

    status: str
    version: str


class Readiness(Answer):
    """Whether scans are taken, and whether they are mapped as well; `reasons` why not."""

    takes_scans: bool
    maps: bool
    reasons: list[str]
