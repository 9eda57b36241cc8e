"""The map as a scalable drawing (SVG 1.1)."""

from __future__ import annotations

from typing import assert_never
from xml.sax.saxutils import escape, quoteattr

from lineloom_core.io.drawing import PAPER, Box, Disc, Drawing, Label, Mark, Strokes
from lineloom_core.io.map_drawing import draw_map
from lineloom_core.io.selection import BBox
from lineloom_core.mapping.answers.site_view import SiteView


def write_map(
    view: SiteView, component: str | None = None, bbox: BBox | None = None, site: str = ""
) -> str:
    """Return the map of one component, or of all side by side, as an SVG document.

    bbox: only this part, x_min, y_min, x_max, y_max [m] in the component's map frame. Raises
    UnknownComponentError (a KeyError) or ValueError as `selection.select` does.
    """
    return to_svg(draw_map(view, component, bbox))


def to_svg(drawing: Drawing) -> str:
    """Return a drawing as an SVG document; title and description are read out by screen readers."""
    width, height = _number(drawing.width), _number(drawing.height)
    rows = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" role="img" aria-labelledby="map-title map-desc" '
        'font-family="system-ui, -apple-system, Segoe UI, Helvetica, Arial, sans-serif">',
        f'<title id="map-title">{escape(drawing.title)}</title>',
        f'<desc id="map-desc">{escape(drawing.description)}</desc>',
        f'<rect width="{width}" height="{height}" fill="{PAPER}"/>',
    ]
    rows.extend(_element(mark) for mark in drawing.marks)
    rows.append("</svg>\n")
    return "\n".join(rows)


def _element(mark: Mark) -> str:
    match mark:
        case Strokes():
            return _strokes(mark)
        case Disc():
            return (
                f'<circle cx="{_number(mark.x)}" cy="{_number(mark.y)}" r="{_number(mark.radius)}" '
                f'fill="{mark.fill}" stroke="{mark.colour}" stroke-width="{_number(mark.width)}"/>'
            )
        case Box():
            return (
                f'<rect x="{_number(mark.x)}" y="{_number(mark.y)}" width="{_number(mark.width)}" '
                f'height="{_number(mark.height)}" fill="none" stroke="{mark.colour}"/>'
            )
        case Label():
            halo = (
                f' stroke="{PAPER}" stroke-width="3" paint-order="stroke" stroke-linejoin="round"'
                if mark.halo
                else ""
            )
            return (
                f'<text x="{_number(mark.x)}" y="{_number(mark.y)}" '
                f'font-size="{_number(mark.size)}" fill="{mark.colour}" '
                f'text-anchor="{mark.anchor}"{halo}>{escape(mark.text)}</text>'
            )
        case _:
            assert_never(mark)


def _strokes(mark: Strokes) -> str:
    path = "".join(
        "M" + "L".join(f"{_number(x)} {_number(y)}" for x, y in line) for line in mark.lines
    )
    label = f" data-name={quoteattr(mark.name)}" if mark.name else ""
    return (
        f'<path d="{path}" fill="none" stroke="{mark.colour}" '
        f'stroke-width="{_number(mark.width)}" stroke-opacity="{_number(mark.opacity)}" '
        f'stroke-linecap="round" stroke-linejoin="round"{label}/>'
    )


def _number(value: float) -> str:
    """Return a hundredth of a pixel, without trailing zeros."""
    return f"{value:.2f}".rstrip("0").rstrip(".")
