"""Scenes whose lines and ends are known exactly."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from lineloom_core.features import (
    EDGE,
    INTERIOR,
    UNKNOWN,
    ExtractionConfig,
    ScanFeatures,
    extract_features,
)
from lineloom_core.features._kernels import LENGTH, THETA
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from lineloom_lab.simulation import Lidar, World, rectangle
from numpy.typing import NDArray

ONE_DEGREE = math.radians(1.0)
AHEAD = Lidar(math.radians(-60.0), ONE_DEGREE, 121, range_sigma=0.0)
TO_THE_LEFT = Lidar(math.radians(-60.0), ONE_DEGREE, 151, range_sigma=0.0)
FULL_TURN = Lidar(-math.pi, math.tau / 720, 720, range_sigma=0.0)


def scan_of(walls: Sequence[tuple[float, float, float, float]], lidar: Lidar = AHEAD) -> Scan:
    """A sweep without noise from the origin, looking along x."""
    world = World(np.array(walls))
    return lidar.scan(world, Pose.identity(), np.random.default_rng(0))


def seen(walls: Sequence[tuple[float, float, float, float]], lidar: Lidar = AHEAD) -> ScanFeatures:
    return extract_features(scan_of(walls, lidar))


def sweep(ranges: NDArray[np.float64], angle_min: float, increment: float) -> ScanFeatures:
    scan = Scan.checked(
        ranges,
        angle_min=angle_min,
        angle_increment=increment,
        range_min=0.0,
        range_max=30.0,
        stamp=0.0,
    )
    return extract_features(scan)


def test_a_corner_between_two_walls_is_an_edge_of_both() -> None:
    features = seen([(4.0, -20.0, 4.0, 3.0), (4.0, 3.0, -20.0, 3.0)], TO_THE_LEFT)
    np.testing.assert_allclose(features.lines[:, THETA], [math.pi / 2, math.pi], atol=1e-9)
    np.testing.assert_array_equal(features.ends, [[INTERIOR, EDGE], [EDGE, INTERIOR]])
    np.testing.assert_allclose(features.edges[0, 1], [4.0, 3.0], atol=1e-9)
    np.testing.assert_allclose(features.edges[1, 0], [4.0, 3.0], atol=1e-9)


def test_a_room_seen_all_around_has_four_walls_and_four_corners() -> None:
    """The seam of the sweep looks at a corner, so that no wall is cut in two by it."""
    here = (3.0, 2.0)
    pose = Pose(*here, math.atan2(here[1], here[0]))
    features = extract_features(FULL_TURN.scan(rectangle(8.0, 5.0), pose, np.random.default_rng(0)))
    assert len(features) == 4
    assert np.all(features.ends == EDGE)
    found = pose.transform(features.edges.reshape(-1, 2)).reshape(-1, 2, 2)
    around = [(0.0, 0.0), (8.0, 0.0), (8.0, 5.0), (0.0, 5.0)]
    np.testing.assert_allclose(found[:, 0], around, atol=1e-6)
    np.testing.assert_allclose(found[:, 1], around[1:] + around[:1], atol=1e-6)


def test_the_seam_cuts_a_wall_in_two_but_is_no_edge() -> None:
    pose = Pose(3.0, 2.0, 0.0)  # the seam looks at the wall x = 0
    features = extract_features(FULL_TURN.scan(rectangle(8.0, 5.0), pose, np.random.default_rng(0)))
    assert len(features) == 5
    expected = [[INTERIOR, EDGE], [EDGE, EDGE], [EDGE, EDGE], [EDGE, EDGE], [EDGE, INTERIOR]]
    np.testing.assert_array_equal(features.ends, expected)
    np.testing.assert_allclose(
        features.lines[[0, 4], THETA], [-math.pi / 2, -math.pi / 2], atol=1e-9
    )
    ends = pose.transform(features.edges.reshape(-1, 2)).reshape(-1, 2, 2)
    np.testing.assert_allclose(ends[0, 1], [0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(ends[4, 0], [0.0, 5.0], atol=1e-6)


def test_a_repeated_first_beam_is_no_edge_either() -> None:
    lidar = Lidar(-math.pi, math.tau / 720, 721, range_sigma=0.0)
    features = extract_features(
        lidar.scan(rectangle(8.0, 5.0), Pose(3.0, 2.0, 0.0), np.random.default_rng(0))
    )
    assert len(features) == 5
    assert features.ends[0, 0] == INTERIOR
    assert features.ends[-1, 1] == INTERIOR


def test_what_stands_in_front_ends_and_what_is_behind_goes_on() -> None:
    features = seen([(2.0, -0.5, 2.0, 0.5), (5.0, -30.0, 5.0, 30.0)])
    assert len(features) == 3
    before, front, after = range(3)
    np.testing.assert_array_equal(features.ends[front], [EDGE, EDGE])
    np.testing.assert_array_equal(features.ends[before], [INTERIOR, INTERIOR])
    np.testing.assert_array_equal(features.ends[after], [INTERIOR, INTERIOR])
    np.testing.assert_allclose(features.edges[front], [[2.0, -0.5], [2.0, 0.5]], atol=0.04)
    assert features.lines[front, LENGTH] == pytest.approx(1.0, abs=0.08)


def test_an_end_beside_a_beam_without_return_is_unknown() -> None:
    features = seen([(2.0, -0.5, 2.0, 0.5)])
    np.testing.assert_array_equal(features.ends, [[UNKNOWN, UNKNOWN]])


def test_a_step_in_a_wall_is_an_edge_of_its_nearer_half_only() -> None:
    features = seen([(3.0, -30.0, 3.0, 0.005), (3.6, 0.005, 3.6, 30.0)])
    np.testing.assert_array_equal(features.ends, [[INTERIOR, EDGE], [INTERIOR, INTERIOR]])
    np.testing.assert_allclose(features.edges[0, 1], [3.0, 0.0], atol=1e-9)


def test_glass_or_a_grille_makes_two_surfaces_of_alternating_beams() -> None:
    angles = np.radians(np.arange(-30.0, 31.0))
    ranges = np.where(np.arange(61) % 2 == 0, 2.0, 4.0) / np.cos(angles)
    features = sweep(ranges, float(angles[0]), ONE_DEGREE)
    assert len(features) == 2
    np.testing.assert_allclose(features.lines[:, THETA], math.pi / 2, atol=1e-9)
    np.testing.assert_allclose(sorted(features.lines[:, 0]), [2.0, 4.0], atol=1e-9)
    assert np.count_nonzero(features.breaks) == 2


@pytest.mark.parametrize(("missing", "lines"), [(3, 1), (7, 1), (20, 2)])
def test_a_wall_goes_on_behind_a_small_gap_only(missing: int, lines: int) -> None:
    """Seven beams break a surface; at 2 m they leave 0.28 m, within `max_gap`; twenty do not."""
    scan = scan_of([(2.0, -3.0, 2.0, 3.0)])
    ranges = scan.ranges.copy()
    first = 60 - missing // 2
    ranges[first : first + missing] = math.nan
    features = sweep(ranges, scan.angle_min, scan.angle_increment)
    assert len(features) == lines
    if lines == 2:
        assert features.ends[0, 1] == UNKNOWN
        assert features.ends[1, 0] == UNKNOWN
    assert features.lines[:, LENGTH].sum() > 4.5


def test_short_and_sparse_pieces_are_left_out() -> None:
    piece = [(1.0, -0.09, 1.0, 0.09)]
    assert len(seen(piece)) == 0
    assert len(extract_features(scan_of(piece), ExtractionConfig(min_length=0.1))) == 1
    far = [(20.0, -0.6, 20.0, 0.6)]  # 1.2 m, but three beams
    assert len(seen(far)) == 0
    assert len(extract_features(scan_of(far), ExtractionConfig(min_points=3))) == 1


def test_an_obtuse_corner_is_split_and_its_edge_is_exact() -> None:
    features = seen(
        [(4.0, -20.0, 4.0, 1.0), (4.0, 1.0, 2.0, 6.0), (2.0, 6.0, -20.0, 6.0)], TO_THE_LEFT
    )
    assert len(features) == 3
    np.testing.assert_array_equal(features.ends, [[INTERIOR, EDGE], [EDGE, EDGE], [EDGE, INTERIOR]])
    np.testing.assert_allclose(features.edges[1], [[4.0, 1.0], [2.0, 6.0]], atol=1e-9)


def test_walls_that_would_meet_beyond_reach_have_no_angle_edge() -> None:
    """A bevelled corner: the walls' intersection is 0.7 m from their ends."""
    bevelled = [(4.0, -20.0, 4.0, 2.3), (4.0, 2.3, 3.3, 3.0), (3.3, 3.0, -20.0, 3.0)]
    edges = seen(bevelled, TO_THE_LEFT).edges.reshape(-1, 2)
    assert np.linalg.norm(edges - [4.0, 3.0], axis=1).min() > 0.3


def test_lines_come_in_the_order_of_the_sweep() -> None:
    features = seen([(3.0, -4.0, 3.0, -1.0), (2.5, -0.8, 2.5, 0.8), (3.0, 1.0, 3.0, 4.0)])
    bearings = np.arctan2(features.lines[:, 1], features.lines[:, 0])
    assert len(features) == 3
    assert np.all(np.diff(bearings) > 0.0)
