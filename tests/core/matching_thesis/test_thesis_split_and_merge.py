"""Algorithm 1 on points whose lines are known (thesis §3.2)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.thesis.config import PrimitiveConfig
from lineloom_core.matching.thesis.line_segments import LineSegments, intersection
from lineloom_core.matching.thesis.split_and_merge import (
    farthest_point,
    fit_line,
    merge_collinear,
    part,
    split_and_merge,
    surfaces,
)
from numpy.typing import NDArray

CONFIG = PrimitiveConfig()
STEP = math.radians(1.0)


def sweep_of(ranges: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    angles = -math.pi / 2 + STEP * np.arange(len(ranges))
    hit = np.flatnonzero(np.isfinite(ranges))
    r, a = ranges[hit], angles[hit]
    return np.column_stack([r * np.cos(a), r * np.sin(a)]), hit


def room_ranges(half_width: float = 3.0, depth: float = 4.0) -> NDArray[np.float64]:
    """A room seen from the middle of its open side: right wall, far wall, left wall."""
    angles = -math.pi / 2 + STEP * np.arange(181)
    with np.errstate(divide="ignore"):
        side = half_width / np.abs(np.sin(angles))
        far = depth / np.maximum(np.cos(angles), 1e-12)
    ranges: NDArray[np.float64] = np.minimum(side, far)
    return ranges


def extract(ranges: NDArray[np.float64], config: PrimitiveConfig = CONFIG) -> LineSegments:
    points, beams = sweep_of(ranges)
    return split_and_merge(points, beams, STEP, config)


@pytest.mark.parametrize("break_angle", [0.0, math.radians(8.0)])
def test_a_room_has_three_walls(break_angle: float) -> None:
    """With one set in the beginning, as printed, and with one per surface."""
    lines = extract(room_ranges(), replace(CONFIG, break_angle=break_angle))
    assert np.degrees(lines.directions) == pytest.approx([0.0, 90.0, 180.0], abs=1e-9)
    assert lines.offsets == pytest.approx([-3.0, -4.0, -3.0])
    assert np.all(lines.first[1:] > lines.last[:-1])  # counter-clockwise, no beam in two lines
    assert int((lines.last - lines.first + 1).sum()) == 181  # and no beam in none


def test_the_farthest_point_is_measured_from_the_chord() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.2], [2.0, -0.5], [3.0, 0.0]])
    assert farthest_point(points, 0, 3) == (2, 0.5)
    assert farthest_point(points, 0, 1) == (0, 0.0)  # two points are a line
    closed = np.array([[0.0, 0.0], [3.0, 4.0], [0.0, 0.0]])
    assert farthest_point(closed, 0, 2) == (1, 5.0)  # no chord: the distance from the point


def test_a_split_point_goes_to_the_nearer_line() -> None:
    corner_last = np.array([[0, 0], [1, 0], [2, 0], [3, 0], [3.1, 1], [3.1, 2], [3.1, 3]], float)
    assert part(corner_last, [(0, 3), (3, 6)]) == [(0, 3), (4, 6)]
    corner_first = corner_last[::-1]
    assert part(corner_first, [(0, 3), (3, 6)]) == [(0, 2), (3, 6)]


def test_collinear_neighbours_are_merged_and_doorways_are_not() -> None:
    along = np.concatenate([np.arange(0.0, 2.0, 0.1), np.arange(3.0, 5.0, 0.1)])
    points = np.column_stack([along, np.full_like(along, 2.0)])
    assert merge_collinear(points[:20], [(0, 9), (10, 19)], CONFIG) == [(0, 19)]
    assert merge_collinear(points[:20], [(0, 4), (5, 9), (10, 19)], CONFIG) == [(0, 19)]
    wide = replace(CONFIG, max_gap=0.3)
    assert merge_collinear(points, [(0, 18), (20, 39)], wide) == [(0, 18), (20, 39)]


def test_lines_in_every_direction_can_be_fitted() -> None:
    """Least squares of y on x would lose the wall along y."""
    for angle in np.arange(-math.pi, math.pi, 0.3):
        u = np.array([math.cos(angle), math.sin(angle)])
        centre, direction = fit_line(np.outer(np.arange(5.0), u))
        assert direction == pytest.approx(u)
        assert centre == pytest.approx(2.0 * u)


def test_a_jump_ends_a_surface() -> None:
    ranges = np.full(40, 3.0)
    ranges[20:] = 5.0
    points, beams = sweep_of(ranges)
    assert surfaces(points, beams, STEP, CONFIG) == [(0, 19), (20, 39)]
    assert surfaces(points, beams, STEP, replace(CONFIG, break_angle=0.0)) == [(0, 39)]
    ranges[:] = 3.0
    ranges[10:20] = np.nan
    points, beams = sweep_of(ranges)
    assert surfaces(points, beams, STEP, CONFIG) == [(0, 9), (10, 29)]


def test_noise_bends_no_wall() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        noise = np.clip(0.0125 * rng.standard_normal(181), -0.025, 0.025)
        lines = extract(room_ranges() + noise)
        assert len(lines) == 3
        off = wrap_array(lines.directions - np.radians([0.0, 90.0, 180.0]))
        assert np.abs(np.degrees(off)).max() < 0.3


def test_nothing_and_too_little_give_no_line() -> None:
    assert len(extract(np.full(181, np.inf))) == 0
    few = np.full(181, np.inf)
    few[90:93] = 2.0
    assert len(extract(few)) == 0


def test_intersections() -> None:
    lines = LineSegments.of([[0, 0, 2, 0], [5, -1, 5, 1], [0, 3, 1, 3]])
    t, o = lines.directions, lines.offsets
    point, sine = intersection(t[0], o[0], t[1], o[1])
    assert point == pytest.approx([5.0, 0.0])
    assert float(sine) == pytest.approx(1.0)
    assert abs(float(intersection(t[0], o[0], t[2], o[2])[1])) < 1e-12
