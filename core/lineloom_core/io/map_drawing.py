"""Lays out a site's map on a page: components side by side, legend and scale bar below."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

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
from lineloom_core.io.selection import BBox, ComponentContent, clip, select
from lineloom_core.mapping.site_view import MapLine, SiteView

DEFAULT_WIDTH_PX = 1600

_MARGIN = 28.0
_HEADER = 30.0
_FOOTER = 78.0
_GAP = 36.0
_PANEL_PADDING = 14.0
_FONT = 15.0
_LEAST_EXTENT_M = 2.0
_TALLEST = 1.1  # height over width beyond which the scale gives in
_SOLID_FROM = 8  # keyframes from which a wall is drawn at full strength


@dataclass(frozen=True)
class _Panel:
    """One component on the page: world box, and the pixel of its upper left corner."""

    content: ComponentContent
    bounds: BBox
    left: float
    top: float
    scale: float

    def at(self, x: float, y: float) -> tuple[float, float]:
        return (
            self.left + (x - self.bounds[0]) * self.scale,
            self.top + (self.bounds[3] - y) * self.scale,
        )

    @property
    def size(self) -> tuple[float, float]:
        x_min, y_min, x_max, y_max = self.bounds
        return (x_max - x_min) * self.scale, (y_max - y_min) * self.scale


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
    panels = _lay_out(shown, bbox, float(width_px))
    bottom = max((p.top + p.size[1] for p in panels), default=_MARGIN + 120.0)
    marks: list[Mark] = []
    for panel in panels:
        marks.extend(_panel_marks(panel, colours))
    if not panels:
        marks.append(Label(width_px / 2, bottom - 50.0, "No map yet", 1.4 * _FONT, MUTED, "middle"))
    below = bottom + _PANEL_PADDING
    scale = panels[0].scale if panels else None
    marks.extend(_footer(view, shown, colours, scale, float(width_px), below))
    title, description = _words(view, shown)
    return Drawing(float(width_px), below + _FOOTER, title, description, tuple(marks))


def _colours(view: SiteView) -> dict[str, str]:
    """Give each robot of the site its colour, the same in every picture of the site."""
    names = {*view.robots, *view.trajectories, *(name for w in view.lines for name in w.robots)}
    return {name: robot_colour(i) for i, name in enumerate(sorted(names))}


def _lay_out(
    contents: Sequence[ComponentContent], bbox: BBox | None, width: float
) -> tuple[_Panel, ...]:
    """Place the components side by side at one common scale."""
    if not contents:
        return ()
    bounds = [bbox or _bounds(c) for c in contents]
    room = width - 2 * _MARGIN - (len(contents) - 1) * _GAP - 2 * _PANEL_PADDING * len(contents)
    scale = max(room, 50.0) / sum(b[2] - b[0] for b in bounds)
    tallest = max(b[3] - b[1] for b in bounds)
    scale = min(scale, _TALLEST * width / tallest)
    used = sum(b[2] - b[0] for b in bounds) * scale
    left = _MARGIN + _PANEL_PADDING + max(room - used, 0.0) / 2
    panels = []
    for content, box in zip(contents, bounds, strict=True):
        top = _MARGIN + _HEADER + _PANEL_PADDING + (tallest - (box[3] - box[1])) * scale / 2
        panels.append(_Panel(content, box, left, top, scale))
        left += (box[2] - box[0]) * scale + 2 * _PANEL_PADDING + _GAP
    return tuple(panels)


def _bounds(content: ComponentContent) -> BBox:
    x = [v for line in content.lines for v in (line.x1, line.x2)]
    y = [v for line in content.lines for v in (line.y1, line.y2)]
    for path in content.paths:
        x += [float(path.poses[:, 0].min()), float(path.poses[:, 0].max())]
        y += [float(path.poses[:, 1].min()), float(path.poses[:, 1].max())]
    if not x:
        return (-1.0, -1.0, 1.0, 1.0)
    grow_x = max(0.0, _LEAST_EXTENT_M - (max(x) - min(x))) / 2
    grow_y = max(0.0, _LEAST_EXTENT_M - (max(y) - min(y))) / 2
    return (min(x) - grow_x, min(y) - grow_y, max(x) + grow_x, max(y) + grow_y)


def _panel_marks(panel: _Panel, colours: Mapping[str, str]) -> Iterator[Mark]:
    width, height = panel.size
    pad = _PANEL_PADDING
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


def _wall_marks(panel: _Panel, colours: Mapping[str, str]) -> Iterator[Strokes]:
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


def _footer(
    view: SiteView,
    contents: Sequence[ComponentContent],
    colours: Mapping[str, str],
    scale: float | None,
    width: float,
    top: float,
) -> Iterator[Mark]:
    names = sorted({name for c in contents for name in c.component.robots if name in colours})
    entries = [(name, colours[name]) for name in names]
    if len(names) > 1:
        entries.append(("seen by several", INK))
    x, y = _MARGIN, top + 26.0
    for text, colour in entries:
        needed = 34.0 + text_width(text, _FONT) + 22.0
        if x > _MARGIN and x + needed > width - _MARGIN:
            x, y = _MARGIN, y + 22.0
        yield Strokes((((x, y - 5.0), (x + 26.0, y - 5.0)),), colour, 3.0, name="legend")
        yield Label(x + 34.0, y, text, _FONT)
        x += needed
    note = f"version {view.version} · wider and darker = seen in more keyframes"
    yield Label(_MARGIN, top + 62.0, note, 0.85 * _FONT, MUTED)
    if scale is None:
        return
    metres = _round_length(0.16 * width / scale)
    right, base = width - _MARGIN, top + 54.0
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
