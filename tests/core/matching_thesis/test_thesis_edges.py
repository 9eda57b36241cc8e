"""Edge and interior points; angle, jump and virtual edges (thesis §3.2, §3.3, Fig. 3.6, 3.7)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.matching.thesis import PrimitiveConfig, Primitives, extract_primitives
from lineloom_core.matching.thesis.edges import ANGLE, JUMP, NONE, VIRTUAL
from lineloom_core.matching.thesis.primitives import primitives_of_features, transform_to_points
from lineloom_core.scan import Scan
from lineloom_lab.simulation import Lidar, World, rectangle, scanner_360, sick_lms200

EXACT = Lidar(-math.pi / 2, math.radians(1.0), 181, range_sigma=0.0)
# A room whose left wall is hidden beyond a screen that stands in front of it, as in Fig. 3.7.
SCREEN = World(
    np.array([[-1, -3, 5, -3], [5, -3, 5, 3], [5, 3, -1, 3], [3.5, 1.5, 2.5, 1.5]], dtype=float)
)


def scan_of(world: World, lidar: Lidar = EXACT, pose: Pose | None = None) -> Scan:
    return lidar.scan(world, pose or Pose.identity(), np.random.default_rng(0))


def seen(config: PrimitiveConfig | None = None) -> Primitives:
    return extract_primitives(scan_of(SCREEN), config)


def test_the_walls_behind_the_screen_and_before() -> None:
    """Right wall, far wall, screen, left wall, in counter-clockwise order."""
    lines = seen().L
    assert np.degrees(lines.directions) == pytest.approx([0.0, 90.0, 180.0, 180.0], abs=0.5)
    ends = list(zip(lines.s_is_edge.tolist(), lines.e_is_edge.tolist(), strict=True))
    assert ends == [
        (False, True),  # from the border of the view (interior) to the corner
        (True, False),  # from the corner to where the screen hides it (interior)
        (True, True),  # both ends of the screen: a complete line segment
        (False, False),  # from behind the screen to the border of the view
    ]
    assert lines.is_complete.tolist() == [False, False, True, False]


def test_the_corner_is_an_angle_edge_and_the_screen_ends_in_jump_edges() -> None:
    E = seen().E
    assert E.kind.tolist() == [ANGLE, JUMP, JUMP]
    assert E.lines.tolist() == [[0, 1], [NONE, 2], [2, NONE]]
    assert E.point[0] == pytest.approx([5.0, -3.0], abs=1e-6)
    assert E.point[1] == pytest.approx([3.5, 1.5], abs=0.2)  # within a beam's spacing
    assert E.point[2] == pytest.approx([2.5, 1.5], abs=0.1)
    assert math.degrees(E.beta[0]) == pytest.approx(90.0, abs=0.5)


def test_an_angle_edge_ends_its_lines() -> None:
    """Line segments reach into their corner, wherever the beams fell."""
    lines = seen().L
    assert lines.e[0] == pytest.approx([5.0, -3.0], abs=1e-6)
    assert lines.s[1] == pytest.approx([5.0, -3.0], abs=1e-6)


def test_what_the_missing_line_of_a_jump_edge_may_be() -> None:
    """It starts in the shadow: from straight back along the line to along the beam (Fig. 4.2)."""
    E, lines = seen().E, seen().L
    for n, end in ((1, lines.s[2]), (2, lines.e[2])):
        beam = math.degrees(math.atan2(end[1], end[0]))
        low, high = np.degrees([E.beta[n] - E.beta_slack[n], E.beta[n] + E.beta_slack[n]])
        assert low == pytest.approx(180.0, abs=0.5)
        expected = 180.0 + (180.0 - beam) if n == 1 else 180.0 + beam
        assert high == pytest.approx(expected, abs=0.5)


def test_virtual_edges_are_all_other_intersections() -> None:
    E = seen(PrimitiveConfig(virtual_edges=True)).E
    virtual = E.kind == VIRTUAL
    pairs = {frozenset(p) for p in E.lines[virtual].tolist()}
    # 0, 2 and 3 are parallel; (0, 1) is the angle edge.
    assert pairs == {frozenset({1, 2}), frozenset({1, 3})}
    assert np.all(np.sin(E.beta[virtual]) > 0.0)  # the second line lies counter-clockwise
    assert not np.any(seen().E.kind == VIRTUAL)  # off by default


def test_a_full_turn_has_no_border() -> None:
    world = rectangle(6.0, 4.0)
    found = extract_primitives(scan_of(world, scanner_360(), Pose(2.0, 1.5, 0.4)))
    assert found.full_turn
    corners = found.E.lines[found.E.kind == ANGLE]
    assert len(corners) == 4
    # Four corners; the wall at the scan's seam may come in two pieces.
    assert np.sort(found.L.lengths[found.L.is_complete])[-3:] == pytest.approx(
        [4.0, 6.0, 6.0], abs=0.05
    )


def test_a_neighbour_without_return_makes_no_edge_point() -> None:
    scan = scan_of(World(np.array([[2.0, -1.0, 2.0, 1.0]])))
    lines = extract_primitives(scan).L
    assert len(lines) == 1
    assert not lines.s_is_edge[0]
    assert not lines.e_is_edge[0]


def test_points_follow_the_text() -> None:
    scan = scan_of(rectangle(), sick_lms200(), Pose(2.0, 2.0, 0.3))
    points, beams = transform_to_points(scan)
    i = 100
    angle = scan.angle_min + beams[i] * scan.angle_increment
    r = scan.ranges[beams[i]]
    assert points[i] == pytest.approx([r * math.cos(angle), r * math.sin(angle)])
    assert len(points) == int(np.isfinite(scan.ranges).sum())


def test_a_clockwise_scan_shows_the_same() -> None:
    scan = scan_of(SCREEN)
    reversed_scan = Scan.checked(
        scan.ranges[::-1],
        angle_min=math.pi / 2,
        angle_increment=-scan.angle_increment,
        range_min=scan.range_min,
        range_max=scan.range_max,
        stamp=0.0,
    )
    a, b = seen(), extract_primitives(reversed_scan)
    assert b.L.s == pytest.approx(a.L.s)
    assert b.E.lines.tolist() == a.E.lines.tolist()


def test_lines_of_the_default_extraction_get_the_same_edges() -> None:
    scan = scan_of(SCREEN)
    ours, theirs = seen(), primitives_of_features(extract_features(scan))
    assert len(theirs.L) == len(ours.L)
    assert theirs.E.kind.tolist() == ours.E.kind.tolist()
    assert theirs.L.offsets == pytest.approx(ours.L.offsets, abs=0.02)


def test_moving_primitives_moves_them_rigidly() -> None:
    pose = Pose(1.0, -2.0, 2.0)
    still, moved = seen(), seen().moved(pose)
    assert moved.E.point == pytest.approx(pose.transform(still.E.point))
    assert moved.E.beta == pytest.approx(still.E.beta)
    assert moved.L.lengths == pytest.approx(still.L.lengths)
