"""The differences between a plan and a map, as a picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.floorplan.differences import Differences
from lineloom_core.floorplan.plan import lengths
from lineloom_core.io.drawing import FRAME, INK, MUTED, Drawing, Label, Mark, Strokes, text_width
from lineloom_core.io.map_drawing import DEFAULT_WIDTH_PX, scale_bar

_MISSING = "#c1121f"
_NEW = "#0057b8"
_MARGIN = 30.0
_FONT = 15.0
_FOOTER = 84.0


def draw_differences(found: Differences, width_px: int = DEFAULT_WIDTH_PX) -> Drawing:
    """Return plan and map on one page: there, not seen, missing and new walls."""
    layers = (
        ("not seen", found.unseen, FRAME, 1.5),
        ("as planned", found.confirmed, INK, 2.0),
        ("missing", found.missing, _MISSING, 3.5),
        ("new", found.new, _NEW, 3.5),
    )
    points = np.vstack([lines.reshape(-1, 2) for _, lines, _, _ in layers])
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (width_px - 2 * _MARGIN) / max(float(high[0] - low[0]), 1.0)
    bottom = _MARGIN + float(high[1] - low[1]) * scale
    marks: list[Mark] = []
    for name, lines, colour, width in layers:
        marks.append(Strokes(_on_page(lines, low, high, scale), colour, width, name=name))
    x = _MARGIN
    for name, lines, colour, _ in layers:
        text = f"{name}: {lengths(lines).sum():.0f} m"
        marks.append(Strokes((((x, bottom + 39.0), (x + 26.0, bottom + 39.0)),), colour, 3.5))
        marks.append(Label(x + 34.0, bottom + 44.0, text, _FONT, MUTED))
        x += 34.0 + text_width(text, _FONT) + 26.0
    marks += scale_bar(scale, float(width_px), bottom + 30.0)
    description = (
        f"{len(found.missing)} pieces of wall ({lengths(found.missing).sum():.1f} m) are drawn in "
        f"the plan, but free space was seen in their place; {len(found.new)} mapped pieces "
        f"({lengths(found.new).sum():.1f} m) are not in the plan."
    )
    title = "Floor plan and map compared"
    return Drawing(float(width_px), bottom + _FOOTER, title, description, tuple(marks))


def _on_page(
    lines: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], scale: float
) -> tuple[tuple[tuple[float, float], ...], ...]:
    x = _MARGIN + (lines[:, 0::2] - low[0]) * scale
    y = _MARGIN + (high[1] - lines[:, 1::2]) * scale
    rows = np.stack([x, y], axis=2).tolist()
    return tuple(tuple((p[0], p[1]) for p in row) for row in rows)
