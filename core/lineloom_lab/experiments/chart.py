"""A chart of curves or dots over two axes, as marks on a page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from lineloom_core.io.drawing import FRAME, INK, MUTED, Box, Label, Mark, Strokes
from numpy.typing import NDArray

from lineloom_lab.experiments.frame import FONT, TITLE_FONT, Frame, LegendEntry, legend

_LEFT, _RIGHT, _TOP, _BOTTOM = 62.0, 16.0, 72.0, 48.0
_CLIP_QUANTILE, _CLIP_FACTOR = 98.0, 3.0


@dataclass(frozen=True, eq=False)
class Series:
    """Points of one curve. x, y: (n,), y may hold NaN. style: how it is drawn. label: "" = none."""

    label: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    colour: str
    style: Literal["line", "dots"] = "line"


@dataclass(frozen=True, slots=True)
class Chart:
    """One diagram. The y axis begins at 0 (no figure of chapter 6 is negative).

    Where a few values are far above all others (a wrong match), the axis ends below them and the
    chart says how many it leaves out.
    """

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]

    def marks(self, frame: Frame) -> Iterator[Mark]:
        """Yield axes, grid, legend and curves inside `frame` [px]."""
        plot = Frame(
            frame.left + _LEFT,
            frame.top + _TOP,
            frame.width - _LEFT - _RIGHT,
            frame.height - _TOP - _BOTTOM,
        )
        x_range = self._x_range()
        x_ticks = [x for x in ticks(*x_range) if x <= x_range[1] * (1.0 + 1e-9)]
        limit, above = self._y_limit()
        y_ticks = ticks(0.0, limit)
        yield from self._words(frame, plot, above)
        yield from _grid(plot, x_range, x_ticks, y_ticks)
        for series in self.series:
            yield from _curve(series, plot, x_range, y_ticks[-1])

    def _x_range(self) -> tuple[float, float]:
        values = np.concatenate([s.x for s in self.series] or [np.zeros(1)])
        low, high = float(values.min(initial=0.0)), float(values.max(initial=0.0))
        return low, high if high > low else low + 1.0

    def _y_limit(self) -> tuple[float, int]:
        """Upper end of the y axis, and how many values lie above it."""
        rows = [s.y[np.isfinite(s.y)] for s in self.series]
        rows = [row for row in rows if len(row)]
        if not rows:
            return 1.0, 0
        top = max(float(row.max()) for row in rows)
        usual = max(float(np.percentile(row, _CLIP_QUANTILE)) for row in rows)
        if top <= _CLIP_FACTOR * usual or usual <= 0.0:
            return top or 1.0, 0
        end = ticks(0.0, 1.3 * usual)[-1]
        return end, sum(int((row > end).sum()) for row in rows)

    def _words(self, frame: Frame, plot: Frame, above: int) -> Iterator[Mark]:
        yield Label(frame.left + 8.0, frame.top + 18.0, self.title, TITLE_FONT, INK)
        entries = tuple(LegendEntry(s.label, s.colour) for s in self.series if s.label)
        yield from legend(entries, plot.left, frame.top + 38.0)
        yield Label(frame.left + 8.0, plot.top - 15.0, self.y_label, FONT, MUTED)
        if above:
            text = f"{above} value{'s' if above > 1 else ''} above, not shown"
            yield Label(plot.right, plot.top - 15.0, text, FONT, "#b42318", "end")
        middle = plot.left + 0.5 * plot.width
        yield Label(middle, frame.bottom - 10.0, self.x_label, FONT, MUTED, "middle")


def ticks(low: float, high: float, wanted: int = 6) -> list[float]:
    """Round numbers from at most `low` to at least `high`, about `wanted` of them."""
    span = high - low if high > low else max(abs(high), 1.0)
    raw = span / max(wanted - 1, 1)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(f * power for f in (1.0, 2.0, 2.5, 5.0, 10.0) if f * power >= raw * (1.0 - 1e-9))
    first, last = math.floor(low / step + 1e-9), math.ceil((low + span) / step - 1e-9)
    return [i * step for i in range(first, last + 1)]


def _grid(
    plot: Frame, x_range: tuple[float, float], x_ticks: list[float], y_ticks: list[float]
) -> Iterator[Mark]:
    for value in y_ticks:
        y = plot.bottom - plot.height * value / y_ticks[-1]
        yield Strokes((((plot.left, y), (plot.right, y)),), FRAME, 1.0)
        yield Label(plot.left - 7.0, y + 4.0, _shown(value, y_ticks), FONT, MUTED, "end")
    low, high = x_range
    for value in x_ticks:
        x = plot.left + plot.width * (value - low) / (high - low)
        yield Strokes((((x, plot.bottom), (x, plot.bottom + 5.0)),), MUTED, 1.0)
        yield Label(x, plot.bottom + 19.0, _shown(value, x_ticks), FONT, MUTED, "middle")
    yield Box(plot.left, plot.top, plot.width, plot.height, FRAME)


def _shown(value: float, among: list[float]) -> str:
    """A tick's number with as many decimals as its step needs."""
    step = among[1] - among[0]
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    if abs(step * 10**decimals - round(step * 10**decimals)) > 1e-6:
        decimals += 1
    return f"{value:.{decimals}f}"


def _curve(
    series: Series, plot: Frame, x_range: tuple[float, float], y_end: float
) -> Iterator[Strokes]:
    x = plot.left + plot.width * (series.x - x_range[0]) / (x_range[1] - x_range[0])
    y = plot.bottom - plot.height * series.y / y_end
    if series.style == "dots":
        kept = np.isfinite(series.y) & (series.y <= y_end)
        dots = tuple(
            ((px, py), (px + 0.01, py))
            for px, py in zip(x[kept].tolist(), y[kept].tolist(), strict=True)
        )
        if dots:
            width = 2.2 if len(dots) > 300 else 4.0
            yield Strokes(dots, series.colour, width, 0.75, series.label)
        return
    lines = tuple(_runs(x, np.maximum(y, plot.top), np.isfinite(series.y)))
    if lines:
        width = 1.0 if len(series.x) > 1000 else 1.8
        yield Strokes(lines, series.colour, width, 0.9, series.label)


def _runs(
    x: NDArray[np.float64], y: NDArray[np.float64], known: NDArray[np.bool_]
) -> Iterator[tuple[tuple[float, float], ...]]:
    """Yield stretches of a curve between its gaps."""
    run: list[tuple[float, float]] = []
    for px, py, is_known in zip(x.tolist(), y.tolist(), known.tolist(), strict=True):
        if is_known:
            run.append((px, py))
        elif run:
            yield tuple(run)
            run = []
    if run:
        yield tuple(run)
