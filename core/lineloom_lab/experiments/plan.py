"""A plan: walls, a map and paths seen from above, as marks on a page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from lineloom_core.io.drawing import FRAME, INK, MUTED, Box, Label, Mark, Strokes
from numpy.typing import NDArray

from lineloom_lab.experiments.frame import FONT, TITLE_FONT, Frame, LegendEntry, legend

_TOP, _BOTTOM, _SIDE, _PADDING = 54.0, 30.0, 8.0, 10.0

Bounds = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Layer:
    """What is drawn in one colour. lines: polylines, each (k, 2) [m] in the plan's frame."""

    label: str
    lines: tuple[NDArray[np.float64], ...]
    colour: str
    width: float = 1.6
    opacity: float = 1.0


@dataclass(frozen=True, slots=True)
class Plan:
    """Layers over each other at one scale, x to the right.

    bounds: the part shown, x_min, y_min, x_max, y_max [m]; all of it if None.
    """

    title: str
    layers: tuple[Layer, ...]
    bounds: Bounds | None = None

    def marks(self, frame: Frame) -> Iterator[Mark]:
        """Yield title, legend, layers and a scale bar inside `frame` [px]."""
        yield Label(frame.left + 8.0, frame.top + 18.0, self.title, TITLE_FONT, INK)
        entries = tuple(LegendEntry(a.label, a.colour) for a in self.layers if a.label)
        yield from legend(entries, frame.left + _SIDE, frame.top + 40.0)
        inner = Frame(
            frame.left + _SIDE,
            frame.top + _TOP,
            frame.width - 2 * _SIDE,
            frame.height - _TOP - _BOTTOM,
        )
        x0, y0, x1, y1 = bounds = self.bounds or self._extent()
        scale = min(
            (inner.width - 2 * _PADDING) / max(x1 - x0, 1e-3),
            (inner.height - 2 * _PADDING) / max(y1 - y0, 1e-3),
        )
        left = inner.left + 0.5 * (inner.width - scale * (x1 - x0))
        low = inner.bottom - 0.5 * (inner.height - scale * (y1 - y0))
        yield Box(inner.left, inner.top, inner.width, inner.height, FRAME)
        for layer in self.layers:
            lines = tuple(
                tuple((left + scale * (x - x0), low - scale * (y - y0)) for x, y in piece.tolist())
                for line in layer.lines
                for piece in (_inside(line, bounds) if self.bounds else [line])
                if len(piece) > 1
            )
            if lines:
                yield Strokes(lines, layer.colour, layer.width, layer.opacity, layer.label)
        yield from _scale_bar(scale, inner)

    def _extent(self) -> Bounds:
        points = np.vstack([line for layer in self.layers for line in layer.lines])
        (x0, y0), (x1, y1) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        return x0, y0, x1, y1


def segments_as_lines(segments: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Rows x1, y1, x2, y2 [m] as polylines of two points."""
    return tuple(segments.reshape(-1, 2, 2))


def _inside(line: NDArray[np.float64], bounds: Bounds) -> list[NDArray[np.float64]]:
    """The pieces of a polyline that lie within `bounds`, cut to a fine grid of its own points."""
    steps = np.hypot(*np.diff(line, axis=0).T)
    fine = [line[:1]]
    cell = 0.005 * max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    for a, b, step in zip(line[:-1], line[1:], steps.tolist(), strict=True):
        count = min(max(math.ceil(step / cell), 1), 20_000)
        fine.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    points = np.vstack(fine)
    x, y = points.T
    within = (x >= bounds[0]) & (x <= bounds[2]) & (y >= bounds[1]) & (y <= bounds[3])
    cuts = np.flatnonzero(np.diff(within.astype(np.int8))) + 1
    pieces = np.split(points, cuts)
    flags = np.split(within, cuts)
    return [p for p, f in zip(pieces, flags, strict=True) if f[0]]


def _scale_bar(scale: float, inner: Frame) -> Iterator[Mark]:
    """A bar of a round length, about an eighth of the panel."""
    raw = 0.125 * inner.width / scale
    power = 10.0 ** math.floor(math.log10(raw))
    length = max(f * power for f in (1.0, 2.0, 5.0) if f * power <= raw * (1.0 + 1e-9))
    y, x = inner.bottom + 16.0, inner.left
    yield Strokes((((x, y), (x + scale * length, y)),), INK, 2.5, name="scale")
    text = f"{length:g} m" if length >= 1.0 else f"{100 * length:g} cm"
    yield Label(x + scale * length + 9.0, y + 0.35 * FONT, text, FONT, MUTED)
