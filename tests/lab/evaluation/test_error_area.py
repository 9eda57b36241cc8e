"""Error area and its percentage (thesis §6.3) against areas computed by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_lab.evaluation.error_area import areas_of_pair, error_area
from numpy.typing import NDArray

HERE = Pose.identity()
# A wall 2 m ahead along y, seen over 90 degrees: an isosceles triangle of 4 m^2.
WALL = np.array([[2.0, -2.0, 2.0, 2.0]])


def area_by_beams(p: NDArray[np.float64], q: NDArray[np.float64]) -> tuple[float, float]:
    """Slow twin: thin sectors over all bearings."""
    bearings = (np.arange(400_000) + 0.5) * (math.tau / 400_000)
    ranges = []
    for x1, y1, x2, y2 in (p, q):
        dx, dy = x2 - x1, y2 - y1
        c, s = np.cos(bearings), np.sin(bearings)
        with np.errstate(divide="ignore", invalid="ignore"):
            r = (x1 * dy - y1 * dx) / (c * dy - s * dx)
            along = ((r * c - x1) * dx + (r * s - y1) * dy) / (dx * dx + dy * dy)
        ranges.append(np.where((r > 0.0) & (along >= 0.0) & (along <= 1.0), r, np.nan))
    a, b = ranges
    both = np.isfinite(a) & np.isfinite(b)
    width = 0.5 * math.tau / 400_000
    between = np.abs(a[both] ** 2 - b[both] ** 2).sum() * width
    return float(between), float((np.minimum(a[both], b[both]) ** 2).sum() * width)


def test_a_scan_on_its_copy_has_no_error_area() -> None:
    area = error_area(WALL, WALL, [(0, 0)], HERE)
    assert area.error == pytest.approx(0.0, abs=1e-12)
    assert area.common == pytest.approx(4.0)
    assert area.percentage == pytest.approx(0.0, abs=1e-9)
    assert area.pairs == 1


def test_a_wall_moved_away_leaves_a_trapezium() -> None:
    """Over the same 90 degrees the wall at 3 m closes 9 m^2: 5 of them are between the two."""
    moved = np.array([[3.0, -3.0, 3.0, 3.0]])
    area = error_area(WALL, moved, [(0, 0)], HERE)
    assert (area.error, area.common) == pytest.approx((5.0, 4.0))
    assert area.percentage == pytest.approx(500.0 / 9.0)


def test_only_shared_bearings_count() -> None:
    """The upper half of the further wall (0 to 45 degrees): 4.5 of 9 m^2, over 2 of 4."""
    upper = np.array([[3.0, 0.0, 3.0, 9.0]])
    area = error_area(WALL, upper, [(0, 0)], HERE)
    assert (area.error, area.common) == pytest.approx((2.5, 2.0))


def test_where_lines_cross_both_sides_add_up() -> None:
    """A_1 to A_4 of Fig. 6.6: nothing cancels. Tilted about its middle (2, 0) by atan 1/2."""
    tilted = np.array([[1.0, -2.0, 3.0, 2.0]])
    between, before = areas_of_pair(WALL[0], tilted[0])
    # Lower sector: the tilted wall, y = 2 x - 4, crosses bearing -45 degrees at (4/3, -4/3).
    near_lower, far_lower = 0.5 * 2.0 * (4.0 / 3.0), 0.5 * 2.0 * 2.0
    # Upper sector: it ends at (3, 2), bearing atan 2/3, where the wall is at (2, 4/3).
    near_upper, far_upper = 0.5 * 2.0 * (4.0 / 3.0), 0.5 * 2.0 * 2.0
    assert between == pytest.approx((far_lower - near_lower) + (far_upper - near_upper))
    assert before == pytest.approx(near_lower + near_upper)


def test_seen_from_the_current_pose() -> None:
    """The reference lines are seen from where the current scan was taken, 1 m ahead and turned."""
    pose = Pose(1.0, 0.5, 0.7)
    current = pose.inverse().transform(WALL.reshape(-1, 2)).reshape(-1, 4)
    exact = error_area(WALL, current, [(0, 0)], pose)
    assert exact.error == pytest.approx(0.0, abs=1e-12)
    assert exact.common == pytest.approx(0.5 * 4.0 * 1.0)  # base 4 m, 1 m away
    slipped = error_area(WALL, current, [(0, 0)], pose @ Pose(0.0, 0.0, 0.05))
    assert slipped.error > 0.01


@pytest.mark.parametrize("seed", range(12))
def test_agrees_with_thin_sectors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, q = rng.uniform(-5.0, 5.0, (2, 4))
    assert areas_of_pair(p, q) == pytest.approx(area_by_beams(p, q), rel=2e-3, abs=2e-3)
    assert areas_of_pair(p, q) == pytest.approx(areas_of_pair(q, p))
    turned = Pose(0.0, 0.0, 2.5).transform(np.vstack([p, q]).reshape(-1, 2)).reshape(2, 4)
    assert areas_of_pair(*turned) == pytest.approx(areas_of_pair(p, q), abs=1e-9)


def test_across_the_back() -> None:
    """Bearings that run over +-180 degrees are as good as others."""
    back = np.array([-2.0, 2.0, -2.0, -2.0])
    assert areas_of_pair(back, 1.5 * back) == pytest.approx((5.0, 4.0))


def test_error_grows_with_injected_errors() -> None:
    """Figures 6.8(a) and (b): against its own copy, more error has more error area."""
    room = np.array([[4, -3, 4, 3], [4, 3, -4, 3], [-4, 3, -4, -3], [-4, -3, 4, -3]], float)
    same = [(i, i) for i in range(4)]
    for axis in (Pose(1.0, 0.0, 0.0), Pose(0.0, 1.0, 0.0), Pose(0.0, 0.0, 1.0)):
        step = axis.to_array() * 0.02
        areas = [error_area(room, room, same, Pose.from_array(step * i)).error for i in range(6)]
        assert np.all(np.diff(areas) > 0.0)


def test_nothing_to_compare() -> None:
    behind = np.array([[-2.0, -2.0, -2.0, 2.0]])
    edge_on = np.array([[1.0, 0.0, 3.0, 0.0]])
    through = np.array([[-1.0, 0.0, 3.0, 0.0]])
    for other in (behind, edge_on, through):
        area = error_area(WALL, other, [(0, 0)], HERE)
        assert (area.error, area.common, area.pairs) == (0.0, 0.0, 0)
        assert math.isnan(area.percentage)
    assert math.isnan(error_area(WALL, WALL, [], HERE).percentage)


def test_wrong_input_is_named() -> None:
    with pytest.raises(ValueError, match="current must have shape"):
        error_area(WALL, WALL[:, :3], [], HERE)
    with pytest.raises(ValueError, match=r"pair \(0, 1\) names no line"):
        error_area(WALL, WALL, [(0, 1)], HERE)
