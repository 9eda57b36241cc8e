"""The map as a picture (PNG)."""

from __future__ import annotations

import io
import math
from typing import assert_never

from PIL import Image, ImageDraw, ImageFont

from lineloom_core.io.drawing import PAPER, Box, Disc, Drawing, Label, Mark, Strokes
from lineloom_core.io.map_drawing import DEFAULT_WIDTH_PX, draw_map
from lineloom_core.io.selection import BBox
from lineloom_core.mapping.answers.site_view import SiteView

MAX_WIDTH_PX = 8000
"""Wider pictures take gigabytes to draw; the SVG scales to any size."""

_OVERSAMPLING = 3
_OVERSAMPLED_PIXELS_MAX = 60e6
MOST_PIXELS = 40e6
"""120 MB while it is drawn."""

_ANCHORS = {"start": "ls", "middle": "ms", "end": "rs"}


class PictureTooLargeError(ValueError):
    """A page that would take more pixels than anybody can use; the text says what would do."""


def write_map(
    view: SiteView,
    component: str | None = None,
    bbox: BBox | None = None,
    site: str = "",
    width_px: int = DEFAULT_WIDTH_PX,
) -> bytes:
    """Return the map of one component, or of all side by side, as a PNG file `width_px` wide.

    The same page as the SVG. Raises UnknownComponentError (a KeyError) or ValueError as
    `selection.select` does, and ValueError for a width outside 200 to 8000 pixels.
    """
    if width_px > MAX_WIDTH_PX:
        raise ValueError(f"width_px must be at most {MAX_WIDTH_PX}")
    return to_png(draw_map(view, component, bbox, width_px))


def to_png(drawing: Drawing) -> bytes:
    """Return a drawing as a PNG file: drawn larger and averaged down, as Pillow draws no edges
    smoothly by itself. Raises PictureTooLargeError."""
    if drawing.width * drawing.height > MOST_PIXELS:
        raise PictureTooLargeError(
            f"the picture would have {drawing.width:.4g} x {drawing.height:.4g} pixels, more than "
            f"{MOST_PIXELS:g}: ask for one component, or for svg, which takes none"
        )
    width, height = round(drawing.width), round(drawing.height)
    factor = _OVERSAMPLING
    while factor > 1 and width * height * factor * factor > _OVERSAMPLED_PIXELS_MAX:
        factor -= 1
    large = Image.new("RGB", (width * factor, height * factor), PAPER)
    canvas = ImageDraw.Draw(large, "RGBA")
    for mark in drawing.marks:
        _draw(canvas, mark, float(factor))
    picture = large.reduce(factor) if factor > 1 else large
    target = io.BytesIO()
    picture.save(target, format="PNG", optimize=False)
    return target.getvalue()


def _draw(canvas: ImageDraw.ImageDraw, mark: Mark, factor: float) -> None:
    match mark:
        case Strokes():
            _draw_strokes(canvas, mark, factor)
        case Disc():
            r, w = (mark.radius + mark.width / 2) * factor, round(mark.width * factor)
            x, y = mark.x * factor, mark.y * factor
            canvas.ellipse((x - r, y - r, x + r, y + r), mark.fill, mark.colour, w)
        case Box():
            corners = (mark.x, mark.y, mark.x + mark.width, mark.y + mark.height)
            scaled = tuple(v * factor for v in corners)
            canvas.rectangle(scaled, outline=mark.colour, width=round(factor))
        case Label():
            canvas.text(
                (mark.x * factor, mark.y * factor),
                mark.text,
                fill=mark.colour,
                font=ImageFont.load_default(mark.size * factor),
                anchor=_ANCHORS[mark.anchor],
                stroke_width=round(1.5 * factor) if mark.halo else 0,
                stroke_fill=PAPER,
            )
        case _:
            assert_never(mark)


def _draw_strokes(canvas: ImageDraw.ImageDraw, mark: Strokes, factor: float) -> None:
    colour = mark.colour + f"{round(255 * mark.opacity):02x}"
    width = max(1, round(mark.width * factor))
    for line in mark.lines:
        points = [(x * factor, y * factor) for x, y in line]
        if len(points) == 2:
            points = _with_caps(points[0], points[1], width / 2)
        canvas.line(points, fill=colour, width=width, joint="curve")


def _with_caps(
    first: tuple[float, float], second: tuple[float, float], cap: float
) -> list[tuple[float, float]]:
    """Lengthen a stroke by its half width at both ends, so that walls meet at corners."""
    dx, dy = second[0] - first[0], second[1] - first[1]
    length = math.hypot(dx, dy)
    if length == 0.0:
        return [first, second]
    dx, dy = cap * dx / length, cap * dy / length
    return [(first[0] - dx, first[1] - dy), (second[0] + dx, second[1] + dy)]
