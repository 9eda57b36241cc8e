"""The fused line map."""

from __future__ import annotations

from lineloom.wire.base import Answer


class MapComponent(Answer):
    """A component and the robots in it; each has its own map frame."""

    id: str
    robots: list[str]


class Line(Answer):
    """A piece of wall; the free side lies on the left of 1 -> 2.

    sigma: standard deviation of the line's position across itself [m]. support: scans that saw
    it. first_seen, last_seen: stamps on the seeing robots' own clocks.
    """

    id: str
    component: str
    x1: float
    y1: float
    x2: float
    y2: float
    sigma: float
    support: int
    robots: list[str]
    first_seen: float
    last_seen: float


class MapAnswer(Answer):
    """All lines of a site at one version."""

    site: str
    version: int
    components: list[MapComponent]
    lines: list[Line]
