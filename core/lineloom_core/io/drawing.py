"""A map as marks on a page: what svg and png share.

Page coordinates are pixels, x to the right, y down, origin at the top left.
"""

from __future__ import annotations

import colorsys
from dataclasses import dataclass
from typing import Literal

PAPER = "#ffffff"
INK = "#1f2933"
MUTED = "#66727f"
FRAME = "#d5dae0"

_ROBOT_COLOURS = (  # after Okabe and Ito 2008: told apart with any kind of colour vision
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#a64d86",
    "#b8860b",
    "#3a9bd0",
)


@dataclass(frozen=True, slots=True)
class Strokes:
    """Open polylines of one look. lines: per line its points (x, y)."""

    lines: tuple[tuple[tuple[float, float], ...], ...]
    colour: str
    width: float
    opacity: float = 1.0
    name: str = ""


@dataclass(frozen=True, slots=True)
class Disc:
    """A circle, filled with `fill` and outlined in `colour`."""

    x: float
    y: float
    radius: float
    colour: str
    fill: str
    width: float = 1.5


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle outline."""

    x: float
    y: float
    width: float
    height: float
    colour: str


@dataclass(frozen=True, slots=True)
class Label:
    """A line of text; (x, y) is the anchor on the base line. halo: a rim in the paper's colour."""

    x: float
    y: float
    text: str
    size: float
    colour: str = INK
    anchor: Literal["start", "middle", "end"] = "start"
    halo: bool = False


Mark = Strokes | Disc | Box | Label


@dataclass(frozen=True, slots=True)
class Drawing:
    """A page of marks, drawn in order. title and description: for those who cannot see it."""

    width: float
    height: float
    title: str
    description: str
    marks: tuple[Mark, ...]


def robot_colour(index: int) -> str:
    """Return the colour of a site's index-th robot: a fixed palette, then ever new hues."""
    if index < len(_ROBOT_COLOURS):
        return _ROBOT_COLOURS[index]
    hue = (index * 0.618033988749895) % 1.0  # the golden ratio spreads any number of hues
    red, green, blue = colorsys.hls_to_rgb(hue, 0.38, 0.65)
    return f"#{round(red * 255):02x}{round(green * 255):02x}{round(blue * 255):02x}"


def tint(colour: str, share: float) -> str:
    """Return `colour` mixed into the paper, `share` of it left."""
    mixed = (
        round(int(PAPER[i : i + 2], 16) * (1.0 - share) + int(colour[i : i + 2], 16) * share)
        for i in (1, 3, 5)
    )
    return "#" + "".join(f"{value:02x}" for value in mixed)


def text_width(text: str, size: float) -> float:
    """Return about how wide a text runs in a sans-serif face [px]: enough to set a legend."""
    return 0.56 * size * len(text)
