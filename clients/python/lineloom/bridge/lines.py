"""The map's lines as the points and colours of a LINE_LIST marker."""

from __future__ import annotations

from dataclasses import dataclass

from lineloom.wire import MapAnswer

Colour = tuple[float, float, float, float]

_SEVERAL: Colour = (0.12, 0.16, 0.20, 1.0)
_ROBOTS: tuple[Colour, ...] = (  # after Okabe and Ito 2008, as in the service's pictures
    (0.0, 0.45, 0.70, 1.0),
    (0.84, 0.37, 0.0, 1.0),
    (0.0, 0.62, 0.45, 1.0),
    (0.65, 0.30, 0.53, 1.0),
    (0.72, 0.53, 0.04, 1.0),
    (0.23, 0.61, 0.82, 1.0),
)


@dataclass(frozen=True)
class LineList:
    """points: two per line, x, y [m] in the component's map frame; a colour for each point."""

    points: tuple[tuple[float, float], ...]
    colours: tuple[Colour, ...]


def line_list(answer: MapAnswer, component: str) -> LineList:
    """Return the lines of a component; those that several robots saw are dark."""
    names = sorted({name for line in answer.lines for name in line.robots})
    colours = {name: _ROBOTS[i % len(_ROBOTS)] for i, name in enumerate(names)}
    points: list[tuple[float, float]] = []
    shown: list[Colour] = []
    for line in answer.lines:
        if line.component == component:
            points += [(line.x1, line.y1), (line.x2, line.y2)]
            shown += 2 * [colours[line.robots[0]] if len(line.robots) == 1 else _SEVERAL]
    return LineList(tuple(points), tuple(shown))
