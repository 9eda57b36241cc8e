"""Where each component goes on the page: rows of panels at one common scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lineloom_core.io.selection import BBox, ComponentContent

MARGIN = 28.0
PANEL_PADDING = 14.0

_HEADER = 30.0
_GAP = 36.0
_LEAST_EXTENT_M = 2.0
_LEAST_SCALE = 1e-6
_TALLEST = 1.1  # height over width beyond which the scale gives in
_HALVINGS = 50


@dataclass(frozen=True)
class Panel:
    """One component on the page: its world box [m], the pixel of the box's upper left corner."""

    content: ComponentContent
    bounds: BBox
    left: float
    top: float
    scale: float

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the pixel of a point in the component's map frame."""
        return (
            self.left + (x - self.bounds[0]) * self.scale,
            self.top + (self.bounds[3] - y) * self.scale,
        )

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the box on the page [px]."""
        return _extent(self.bounds, self.scale)


def lay_out(
    contents: Sequence[ComponentContent], bbox: BBox | None, width: float
) -> tuple[Panel, ...]:
    """Place the components side by side, in as many rows as it takes, in their order.

    One scale for all, the largest at which nothing is wider than the page and the page is not much
    higher than wide (frames and headings of many small components may make it so).
    """
    if not contents:
        return ()
    bounds = [bbox or _bounds(c) for c in contents]
    tallest = max(_TALLEST * width, 1.5 * _height(_rows(bounds, _LEAST_SCALE, width), bounds, 0.0))
    widest = max(b[2] - b[0] for b in bounds)
    low, high = _LEAST_SCALE, max((width - 2 * MARGIN - 2 * PANEL_PADDING) / widest, _LEAST_SCALE)
    if _height(_rows(bounds, high, width), bounds, high) <= tallest:
        low = high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _height(_rows(bounds, middle, width), bounds, middle) <= tallest:
            low = middle
        else:
            high = middle
    return tuple(_place(contents, bounds, low, width))


def _place(
    contents: Sequence[ComponentContent], bounds: Sequence[BBox], scale: float, width: float
) -> list[Panel]:
    panels = []
    top = MARGIN
    for row in _rows(bounds, scale, width):
        sizes = [_extent(bounds[i], scale) for i in row]
        height = max(h for _, h in sizes)
        used = sum(w + 2 * PANEL_PADDING for w, _ in sizes) + (len(row) - 1) * _GAP
        left = (width - used) / 2 + PANEL_PADDING
        for i, (w, h) in zip(row, sizes, strict=True):
            y = top + _HEADER + PANEL_PADDING + (height - h) / 2
            panels.append(Panel(contents[i], bounds[i], left, y, scale))
            left += w + 2 * PANEL_PADDING + _GAP
        top += _HEADER + 2 * PANEL_PADDING + height
    return panels


def _rows(bounds: Sequence[BBox], scale: float, width: float) -> list[list[int]]:
    """Fill rows from the left as text is set; a panel too wide for any has a row of its own."""
    rows: list[list[int]] = []
    used = 0.0
    for i, box in enumerate(bounds):
        needed = _extent(box, scale)[0] + 2 * PANEL_PADDING
        if rows and used + _GAP + needed <= width - 2 * MARGIN + 1e-6:
            rows[-1].append(i)
            used += _GAP + needed
        else:
            rows.append([i])
            used = needed
    return rows


def _height(rows: Sequence[Sequence[int]], bounds: Sequence[BBox], scale: float) -> float:
    return sum(
        _HEADER + 2 * PANEL_PADDING + max(_extent(bounds[i], scale)[1] for i in row) for row in rows
    )


def _extent(box: BBox, scale: float) -> tuple[float, float]:
    return (box[2] - box[0]) * scale, (box[3] - box[1]) * scale


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
