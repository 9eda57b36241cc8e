"""Lays out a site's map on a page: components side by side, legend and scale bar below."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from lineloom_core.io.drawing import (
    FRAME,
    INK,
    MUTED,
    PAPER,
    Box,
    Disc,
    Drawing,
    Label,
    Mark,
    Strokes,
    robot_colour,
    text_width,
    tint,
)
from lineloom_core.io.map_layout import MARGIN, PANEL_PADDING, Panel, lay_out
from lineloom_core.io.selection import BBox, ComponentContent, clip, select
from lineloom_core.mapping.answers.site_view import MapLine, SiteView

DEFAULT_WIDTH_PX = 1600

_FONT = 15.0
_FOOTER = 62.0
_SOLID_FROM = 8  # keyframes from which a wall is drawn at full strength


def draw_map(
    view: SiteView,
    component: str | None = None,
    bbox: BBox | None = None,
    width_px: int = DEFAULT_WIDTH_PX,
) -> Drawing:
    """Return the map of one component or of all of them as marks on a page `width_px` wide.

    Walls that one robot saw have its colour, walls that several saw are dark; the more keyframes
    saw a wall, the wider and more solid it is. Raises as `selection.select` does, and ValueError
    for a page under 200 pixels.
    """
    if width_px < 200:
        raise ValueError("width_px must be at least 200")
    contents = select(view, component, bbox)
    shown = [c for c in contents if c.lines or c.paths or component is not None]
    colours = _colours(view)
    panels = lay_out(shown, bbox, float(width_px))
    bottom = max((p.top + p.size[1] for p in panels), default=MARGIN + 120.0)
    marks: list[Mark] = []
    for panel in panels:
        marks.extend(_panel_marks(panel, colours))
    if not panels:
        marks.append(Label(width_px / 2, bottom - 50.0, "No map yet", 1.4 * _FONT, MUTED, "middle"))
    below = bottom + PANEL_PADDING
    scale = panels[0].scale if panels else None
    legend, below = _legend(shown, colours, float(width_px), below)
    marks.extend(legend)
    marks.extend(_footer(view, scale, float(width_px), below))
    title, description = _words(view, shown)
    return Drawing(float(width_px), below + _FOOTER, title, description, tuple(marks))


def _colours(view: SiteView) -> dict[str, str]:
    """Give each robot of the site its colour, the same in every picture of the site."""
    names = {*view.robots, *view.trajectories, *(name for w in view.lines for name in w.robots)}
    return {name: robot_colour(i) for i, name in enumerate(sorted(names))}


def _panel_marks(panel: Panel, colours: Mapping[str, str]) -> Iterator[Mark]:
    width, height = panel.size
    pad = PANEL_PADDING
    yield Box(panel.left - pad, panel.top - pad, width + 2 * pad, height + 2 * pad, FRAME)
    component = panel.content.component
    heading = f"{component.id}: {', '.join(component.robots)}"
    room = max(int((width + 2 * pad) / (0.56 * _FONT)), 6)
    if len(heading) > room:
        heading = heading[: room - 1] + "…"
    yield Label(panel.left - pad, panel.top - pad - 8.0, heading, _FONT, MUTED)
    for path in panel.content.paths:
        points = _thinned([panel.at(x, y) for x, y, _ in path.poses.tolist()])
        if len(points) > 1:
            name = f"trajectory of {path.robot}"
            yield Strokes((points,), tint(colours[path.robot], 0.45), 1.6, name=name)
    yield from _wall_marks(panel, colours)
    for robot in panel.content.robots:
        assert robot.pose is not None
        x, y = panel.at(robot.pose.x, robot.pose.y)
        tip = (x + 13.0 * math.cos(robot.pose.theta), y - 13.0 * math.sin(robot.pose.theta))
        colour = colours[robot.robot]
        yield Strokes((((x, y), tip),), colour, 2.5, name=f"heading of {robot.robot}")
        yield Disc(x, y, 6.0, PAPER, colour)
        yield Label(x + 10.0, y - 9.0, robot.robot, 0.9 * _FONT, colour, halo=True)


def _wall_marks(panel: Panel, colours: Mapping[str, str]) -> Iterator[Strokes]:
    """Yield the walls grouped by look, the best supported on top."""
    groups: dict[tuple[int, str], list[tuple[tuple[float, float], ...]]] = {}
    for line in panel.content.lines:
        inside = clip((line.x1, line.y1, line.x2, line.y2), panel.bounds)
        if inside is not None:
            colour = colours[line.robots[0]] if len(line.robots) == 1 else INK
            ends = (panel.at(inside[0], inside[1]), panel.at(inside[2], inside[3]))
            groups.setdefault((_step(line), colour), []).append(ends)
    for (step, colour), lines in sorted(groups.items()):
        share = step / _SOLID_FROM
        yield Strokes(tuple(lines), colour, 1.0 + 1.8 * share, 0.35 + 0.65 * share, "walls")


def _step(line: MapLine) -> int:
    return max(1, min(line.support, _SOLID_FROM))


def _thinned(points: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Leave out points within half a pixel of the last one kept."""
    kept = points[:1]
    for point in points[1:]:
        if math.hypot(point[0] - kept[-1][0], point[1] - kept[-1][1]) >= 0.5:
            kept.append(point)
    return tuple(kept)


def _legend(
    contents: Sequence[ComponentContent], colours: Mapping[str, str], width: float, top: float
) -> tuple[list[Mark], float]:
    """Return the colours' names, in as many rows as they take, and where the last row ends."""
    names = sorted({name for c in contents for name in c.component.robots if name in colours})
    entries = [(name, colours[name]) for name in names]
    if len(names) > 1:
        entries.append(("seen by several", INK))
    marks: list[Mark] = []
    x, y = MARGIN, top + 26.0
    for text, colour in entries:
        needed = 34.0 + text_width(text, _FONT) + 22.0
        if x > MARGIN and x + needed > width - MARGIN:
            x, y = MARGIN, y + 22.0
        marks.append(Strokes((((x, y - 5.0), (x + 26.0, y - 5.0)),), colour, 3.0, name="legend"))
        marks.append(Label(x + 34.0, y, text, _FONT))
        x += needed
    return marks, y


def _footer(view: SiteView, scale: float | None, width: float, top: float) -> Iterator[Mark]:
    note = f"version {view.version} · wider and darker = seen in more keyframes"
    yield Label(MARGIN, top + 34.0, note, 0.85 * _FONT, MUTED)
    if scale is not None:
        yield from scale_bar(scale, width, top)


def scale_bar(scale: float, width: float, top: float) -> Iterator[Mark]:
    """Yield a bar of a round number of metres at the right of a page `width` wide [px]."""
    metres = _round_length(0.16 * width / scale)
    right, base = width - MARGIN, top + 28.0
    left = right - metres * scale
    bar = ((left, base - 5.0), (left, base), (right, base), (right, base - 5.0))
    yield Strokes((bar,), INK, 1.6, name="scale bar")
    yield Label((left + right) / 2, base + 18.0, f"{metres:g} m", _FONT, INK, "middle")


def _round_length(metres: float) -> float:
    """Return the greatest of 1, 2, 5 times a power of ten that is not above `metres`."""
    power = 10.0 ** math.floor(math.log10(metres))
    return float(max(f * power for f in (1.0, 2.0, 5.0) if f * power <= metres * (1 + 1e-9)))


def _words(view: SiteView, contents: Sequence[ComponentContent]) -> tuple[str, str]:
    walls = [line for c in contents for line in c.lines]
    robots = sorted({name for c in contents for name in c.component.robots})
    length = float(np.sum([math.hypot(w.x2 - w.x1, w.y2 - w.y1) for w in walls]))
    parts = f"{len(contents)} component{'' if len(contents) == 1 else 's'}"
    title = f"Line map of {len(robots)} robot{'' if len(robots) == 1 else 's'}, {parts}"
    each = "; ".join(
        f"component {c.component.id} with {', '.join(c.component.robots)}: {len(c.lines)} lines"
        for c in contents
    )
    description = (
        f"Version {view.version}: {len(walls)} lines, {length:.0f} m of wall in all"
        + (f" ({each})." if each else ".")
        + " Walls that one robot saw and its trajectory have the robot's colour, walls that"
        " several saw are dark."
    )
    return title, description
