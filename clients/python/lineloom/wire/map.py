"""The fused line map."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from lineloom.wire.base import Answer, Settled

Layer = Literal["wall", "furniture", "clutter"]

LAYERS: tuple[Layer, ...] = ("wall", "furniture", "clutter")

USUAL_LAYERS: tuple[Layer, ...] = ("wall", "furniture")
"""What a map shows unless others are asked for."""


class MapComponent(Answer):
    """A component and the robots in it; each has its own map frame."""

    id: str
    robots: list[str]


class Line(Answer):
    """A piece of wall; the free side lies on the left of 1 -> 2.

    sigma: standard deviation of the line's position across itself [m], against the poses of those
    who saw it: its shape, not its place in the map. support: scans that saw it. first_seen,
    last_seen: stamps on the seeing robots' own clocks. layer: `wall` has a metre or more on one
    line, `furniture` less; `clutter` was seen once, or is short and meets nothing. wall: shared by
    the pieces of one wall, which lie on one line; between them are openings.
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
    layer: Layer = "wall"
    wall: str = ""


class MapChanges(Answer):
    """What an answer to `?since=` has besides.

    full: the version asked from is not known (any more), so `lines` is the whole map. Else `lines`
    has only what is new or changed since, and `removed` the ids of lines that are gone, or no
    longer among those asked for; some may never have been.
    """

    since: int | None = None
    full: bool = True
    removed: list[str] = Field(default_factory=list)


class MapAnswer(MapChanges):
    """The lines of a site at one version."""

    site: str
    version: int
    settled: Settled = False
    components: list[MapComponent]
    lines: list[Line]
