"""Charts and plans: round ticks, gaps, what is left out, what lies within."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.io.drawing import Label, Mark, Strokes
from lineloom_core.io.svg import to_svg
from lineloom_lab.experiments.chart import Chart, Series, ticks
from lineloom_lab.experiments.figure import Figure, grid
from lineloom_lab.experiments.frame import Frame
from lineloom_lab.experiments.plan import Layer, Plan

FRAME = Frame(10.0, 20.0, 500.0, 300.0)


def words(marks: list[Mark]) -> list[str]:
    return [mark.text for mark in marks if isinstance(mark, Label)]


def drawn(marks: list[Mark], name: str) -> list[Strokes]:
    return [mark for mark in marks if isinstance(mark, Strokes) and mark.name == name]


@pytest.mark.parametrize(("low", "high"), [(0.0, 3068.0), (0.0, 0.0031), (-2.0, 7.3), (0.0, 0.0)])
def test_ticks_are_round_and_cover(low: float, high: float) -> None:
    found = ticks(low, high)
    assert found[0] <= low
    assert found[-1] >= high * (1.0 - 1e-9)
    assert 3 <= len(found) <= 9
    assert np.diff(found) == pytest.approx(np.full(len(found) - 1, found[1] - found[0]))


def test_a_curve_breaks_at_gaps_and_stays_within_the_frame() -> None:
    y = np.array([1.0, 2.0, np.nan, 4.0, 3.0, 2.0])
    chart = Chart("t", "x", "y", (Series("s", np.arange(6.0), y, "#000000"),))
    marks = list(chart.marks(FRAME))
    (curve,) = drawn(marks, "s")
    assert [len(line) for line in curve.lines] == [2, 3]
    for px, py in (point for line in curve.lines for point in line):
        assert FRAME.left <= px <= FRAME.right
        assert FRAME.top <= py <= FRAME.bottom


def test_a_few_values_far_above_are_left_out_and_counted() -> None:
    y = np.ones(400)
    y[[7, 200]] = 500.0
    chart = Chart("t", "x", "y", (Series("s", np.arange(400.0), y, "#000000", "dots"),))
    marks = list(chart.marks(FRAME))
    assert "2 values above, not shown" in words(marks)
    assert len(drawn(marks, "s")[0].lines) == 398


def test_an_empty_chart_is_no_error() -> None:
    chart = Chart("t", "x", "y", (Series("s", np.zeros(1), np.array([np.nan]), "#000000"),))
    assert "t" in words(list(chart.marks(FRAME)))


def test_a_plan_keeps_its_scale_and_shows_only_what_is_within() -> None:
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]])
    whole = Plan("p", (Layer("a", (line,), "#123456"),))
    (strokes,) = drawn(list(whole.marks(FRAME)), "a")
    (x0, y0), (x1, y1), (x2, y2) = strokes.lines[0]
    assert (x1 - x0) / 10.0 == pytest.approx((y1 - y2) / 5.0)
    assert y0 == y1
    assert x1 == x2
    part = Plan("p", (Layer("a", (line,), "#123456"),), (4.0, -1.0, 6.0, 1.0))
    (inside,) = drawn(list(part.marks(FRAME)), "a")
    points = [point for one in inside.lines for point in one]
    assert all(FRAME.left <= x <= FRAME.right and FRAME.top <= y <= FRAME.bottom for x, y in points)


def test_a_figure_is_as_high_as_its_rows() -> None:
    chart = Chart("t", "x", "y", (Series("s", np.arange(3.0), np.arange(3.0), "#000000"),))
    figures = [Figure("f", "t", "d", grid([chart] * n), 200.0) for n in (2, 3)]
    heights = [figure.drawing().height for figure in figures]
    assert heights[1] - heights[0] == pytest.approx(220.0)
    assert to_svg(figures[1].drawing()).count(">t<") == 5
