"""Each compiled step of feature extraction against its slow, obvious twin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.features import EDGE, INTERIOR, UNKNOWN, ExtractionConfig, extract_features
from lineloom_core.features import _kernels as fast
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from lineloom_lab.simulation import FreeSpace, Lidar, scanner_360, sick_lms200, world_named
from numpy.typing import NDArray

from tests.core.features import slow_twins as slow

Floats = NDArray[np.float64]
CONFIG = ExtractionConfig()


def office_scans(lidar: Lidar, count: int, seed: int) -> list[Scan]:
    """Scans from all over a furnished floor; every other one with beams that do not return."""
    world = world_named("office", seed)
    space = FreeSpace.of(world)
    rng = np.random.default_rng(seed)
    scans = [lidar.scan(world, space.random_pose(rng), rng) for _ in range(count)]
    holed = []
    for i, scan in enumerate(scans):
        ranges = scan.ranges.copy()
        if i % 2:
            ranges[rng.random(len(ranges)) < 0.15] = rng.choice([math.nan, math.inf])
        holed.append(
            Scan.checked(
                ranges,
                angle_min=scan.angle_min + float(rng.uniform(-1.0, 1.0)),
                angle_increment=scan.angle_increment,
                range_min=0.05,
                range_max=30.0,
                stamp=float(i),
            )
        )
    return holed


def rough_surface(seed: int) -> tuple[Floats, NDArray[np.int64], Floats, float]:
    """Points, beams, ranges, increment of a sweep whose neighbours often lie far apart."""
    rng = np.random.default_rng(seed)
    increment = math.radians(float(rng.choice([0.25, 1.0, 2.0])))
    ranges = 4.0 + np.cumsum(rng.normal(0.0, 0.03, 150)) + rng.choice([0.0, 0.4, 1.5], 150)
    ranges[rng.random(150) < 0.2] = np.nan
    xy, beam = slow.points_of(ranges, -1.2, increment)
    return xy, beam, ranges, increment


def polyline(seed: int, corners: int = 6, per_leg: int = 12) -> Floats:
    """Noisy points along straight legs that turn sharply or hardly."""
    rng = np.random.default_rng(seed)
    turns = np.cumsum(rng.choice([0.0, 0.02, 0.4, -0.9, 1.5], corners))
    steps = np.repeat(np.column_stack([np.cos(turns), np.sin(turns)]), per_leg, axis=0)
    points: Floats = np.array([2.0, -6.0]) + 0.08 * np.cumsum(steps, axis=0)
    return points + rng.normal(0.0, 0.01, points.shape)


def break_at(n: int, lasts: list[int]) -> NDArray[np.bool_]:
    breaks = np.zeros(n, dtype=np.bool_)
    breaks[lasts] = True
    return breaks


def as_array(runs: list[slow.Run]) -> NDArray[np.int64]:
    return np.array([*runs, (0, 0, 0)], dtype=np.int64)


@pytest.mark.parametrize("increment", [math.radians(1.0), math.tau / 1080, math.radians(0.25)])
def test_points(increment: float) -> None:
    ranges = np.random.default_rng(1).uniform(0.1, 30.0, 1080)
    ranges[::7], ranges[3::11], ranges[5::13] = np.nan, np.inf, -np.inf
    xy, beam = fast.to_points(ranges, 0.3, increment)
    slow_xy, slow_beam = slow.points_of(ranges, 0.3, increment)
    np.testing.assert_array_equal(beam, slow_beam)
    np.testing.assert_allclose(xy, slow_xy, atol=1e-11)


@pytest.mark.parametrize("seed", range(8))
def test_chains_and_their_breaks(seed: int) -> None:
    xy, beam, ranges, increment = rough_surface(seed)
    order, breaks = fast.cluster_points(xy, beam, ranges, increment, 0.14, 0.015, 6)
    chains = slow.chains_of(xy, beam, increment, 0.14, 0.015, 6)
    assert len(chains) > 3
    np.testing.assert_array_equal(order, [k for chain in chains for k in chain])
    lasts = np.cumsum([len(chain) for chain in chains]) - 1
    np.testing.assert_array_equal(np.flatnonzero(breaks), lasts)


@pytest.mark.parametrize("seed", range(6))
def test_the_point_farthest_from_a_chord(seed: int) -> None:
    xy = polyline(seed)
    for a, b in ((0, len(xy) - 1), (3, 20), (10, 12)):
        where, distance = fast.farthest_from_chord(xy, a, b)
        slow_where, slow_distance = slow.farthest(xy, a, b)
        assert where == slow_where
        assert distance == pytest.approx(slow_distance, abs=1e-12)


def test_the_point_farthest_from_a_chord_without_length() -> None:
    loop = np.array([[1.0, 1.0], [1.5, 1.0], [1.0, 3.0], [1.0, 1.0]])
    assert fast.farthest_from_chord(loop, 0, 3) == (2, 2.0)


@pytest.mark.parametrize("seed", range(8))
def test_split(seed: int) -> None:
    xy = polyline(seed)
    breaks = break_at(len(xy), [0, 20, 21, len(xy) - 1])
    runs = np.empty((len(xy) + 2, 3), dtype=np.int64)
    count = fast.split_clusters(xy, breaks, 0.065, runs)
    expected = slow.split_all(xy, breaks, 0.065)
    assert len(expected) > 4
    np.testing.assert_array_equal(runs[:count], expected)


@pytest.mark.parametrize("seed", range(6))
def test_moments_give_the_plain_total_least_squares_line(seed: int) -> None:
    xy = polyline(seed)
    moments = fast.prefix_moments(xy)
    for a, b in ((0, 11), (12, 23), (5, 7), (0, len(xy) - 1)):
        mx, my, ux, uy, across, along = fast.fit_run(xy, moments, a, b)
        centre, direction, slow_across, slow_along = slow.total_least_squares(xy[a : b + 1])
        np.testing.assert_allclose([mx, my], centre, atol=1e-9)
        np.testing.assert_allclose([ux, uy], direction, atol=1e-7)
        np.testing.assert_allclose([across, along], [slow_across, slow_along], atol=1e-8)
        deviation = slow.worst_deviation(xy[a : b + 1], centre, direction)
        assert fast.max_deviation(xy, a, b, mx, my, ux, uy) == pytest.approx(deviation, abs=1e-7)


@pytest.mark.parametrize("seed", range(8))
def test_merge(seed: int) -> None:
    xy = polyline(seed)
    expected_before = slow.split_all(xy, break_at(len(xy), [30, len(xy) - 1]), 0.03)
    runs = as_array(expected_before)
    count = fast.merge_runs(xy, fast.prefix_moments(xy), runs, len(expected_before), 0.052, 5, 0.3)
    expected = slow.merge(xy, expected_before, 0.052, 5, 0.3)
    assert len(expected) < len(expected_before)
    np.testing.assert_array_equal(runs[:count], expected)


@pytest.mark.parametrize("seed", range(8))
def test_lines(seed: int) -> None:
    xy = polyline(seed)
    beam = np.arange(len(xy), dtype=np.int64) * 2
    runs = slow.split_all(xy, break_at(len(xy), [30, len(xy) - 1]), 0.065)
    args = (0.015, 5, 0.2)
    moments = fast.prefix_moments(xy)
    found = fast.fit_lines(xy, moments, beam, as_array(runs), len(runs), *args)
    expected = slow.lines_of(xy, beam, runs, *args)
    assert len(expected) > 0
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8)


def test_runs_seen_from_behind_make_no_line() -> None:
    upward = np.column_stack([np.full(10, 3.0), np.linspace(-1.0, 1.0, 10)])
    runs = as_array([(0, 9, 0)])
    beam = np.arange(10, dtype=np.int64)
    for xy, count in ((upward, 1), (np.ascontiguousarray(upward[::-1]), 0)):
        lines = fast.fit_lines(xy, fast.prefix_moments(xy), beam, runs, 1, 0.015, 5, 0.2)
        assert len(lines) == count


@pytest.mark.parametrize("seed", range(3))
def test_where_beams_and_lines_meet(seed: int) -> None:
    scan = office_scans(sick_lms200(), 1, 40 + seed)[0]
    lines = extract_features(scan).lines
    assert len(lines) > 3
    for p in lines:
        for angle in np.linspace(-3.0, 3.0, 25):
            assert fast.line_range_at(p, angle) == pytest.approx(slow.range_along(p, angle))
        for q in lines:
            x, y, sine = fast.intersect(p, q)
            turn = float(q[fast.THETA] - p[fast.THETA])
            assert sine == pytest.approx(math.sin(turn), abs=1e-9)
            corner = slow.corner_of(p, q)
            if corner is not None:
                np.testing.assert_allclose([x, y], corner, atol=1e-8)


@pytest.mark.parametrize(("lidar", "count"), [(sick_lms200(), 12), (scanner_360(), 4)])
def test_the_whole_extraction(lidar: Lidar, count: int) -> None:
    seen: set[int] = set()
    for scan in office_scans(lidar, count, 11):
        found = extract_features(scan)
        xy, beam, breaks, lines, ends, edges = slow.extract(
            scan.ranges, scan.angle_min, scan.angle_increment, CONFIG
        )
        assert len(lines) > 1
        np.testing.assert_allclose(found.points, xy, atol=1e-10)
        np.testing.assert_array_equal(found.beams, beam)
        np.testing.assert_array_equal(found.breaks, breaks)
        np.testing.assert_allclose(found.lines, lines, rtol=1e-5, atol=1e-7)
        np.testing.assert_array_equal(found.ends, ends)
        np.testing.assert_allclose(found.edges, edges, atol=1e-6)
        seen |= set(np.unique(ends).tolist())
    assert seen == {INTERIOR, EDGE, UNKNOWN}


def test_normals() -> None:
    with_normal = without = 0
    for scan in office_scans(sick_lms200(), 6, 5):
        found = extract_features(scan)
        expected = slow.normals_of(found.points, found.breaks, 3)
        np.testing.assert_allclose(found.normals(), expected, atol=1e-6)
        length = np.linalg.norm(expected, axis=1)
        with_normal += int(np.count_nonzero(length > 0.5))
        without += int(np.count_nonzero(length < 0.5))
    assert with_normal > 500
    assert without > 10


def test_normals_look_at_the_sensor() -> None:
    world = world_named("rectangle")
    scan = scanner_360().scan(world, Pose(3.0, 2.0, 0.4), np.random.default_rng(0))
    features = extract_features(scan)
    towards = np.einsum("ij,ij->i", features.normals(), -features.points)
    assert np.all(towards >= 0.0)
    assert np.count_nonzero(towards > 0.0) > 900


@pytest.mark.parametrize("side", [0, 1])
def test_how_far_a_beam_must_go_on_beside_an_end(side: int) -> None:
    """A wall 3 m ahead; the beam beside its end goes on by more and more."""
    angles = np.radians(np.arange(-20.0, 21.0))
    ranges = 3.0 / np.cos(angles)
    ranges[[0, -1]] = math.nan
    xy, beam = slow.points_of(ranges, float(angles[0]), math.radians(1.0))
    lines = slow.lines_of(xy, beam, [(0, 38, 0)], 0.015, 5, 0.2)
    types = []
    for beyond in np.arange(-0.1, 0.3, 0.005):
        ranges[-side] = 3.0 / math.cos(math.radians(20.0)) + beyond
        args = (ranges, float(angles[0]), math.radians(1.0), 0.015, False, 0.35)
        ends, _ = fast.classify_ends(lines, *args)
        assert ends[0, side] == slow.end_of(lines, 0, side, *args)[0]
        types.append(int(ends[0, side]))
    assert types == sorted(types)
    assert set(types) == {INTERIOR, EDGE}
