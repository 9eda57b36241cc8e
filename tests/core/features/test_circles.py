"""Circles: compiled steps against slow twins, and scenes whose circles are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.features import _circle_kernels as fast
from lineloom_core.features import extract_features
from lineloom_core.features.circles import CIRCLE_COLUMNS, COLUMN, ROOM, fit_circle
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import (
    FreeSpace,
    Lidar,
    World,
    rectangle,
    round_hall,
    scanner_360,
    sick_lms200,
    world_named,
)
from lineloom_lab.simulation.blueprint import Blueprint
from numpy.typing import NDArray

from tests.core.features import circle_twins as slow

Floats = NDArray[np.float64]
SIGMA = 0.015
FAR_WALLS = World(np.array([[-20.0, 9.0, 20.0, 9.0], [20.0, -9.0, -20.0, -9.0]]))


def arc(seed: int, count: int = 25) -> Floats:
    """Noisy points on a piece of a circle."""
    rng = np.random.default_rng(seed)
    x, y, r = 3.0, float(rng.uniform(-1.0, 1.0)), float(rng.uniform(0.15, 2.0))
    angles = float(rng.uniform(-3.0, 3.0)) + np.linspace(0.0, float(rng.uniform(1.5, 3.0)), count)
    points = np.column_stack([x + r * np.cos(angles), y + r * np.sin(angles)])
    return points + rng.normal(0.0, 0.008, points.shape)


@pytest.mark.parametrize("seed", range(8))
def test_fits(seed: int) -> None:
    xy = arc(seed)
    n, index = len(xy), np.arange(len(xy))
    x, y, r, least = fast.algebraic_circle(xy, index, n)
    np.testing.assert_allclose([x, y, r], slow.algebraic(xy), rtol=1e-6)
    squares = (np.hypot(*(xy - [x, y]).T) ** 2 - r * r) ** 2
    assert least == pytest.approx(squares.sum() / (4.0 * r * r), rel=1e-6)
    circle, C = np.empty(3), np.empty((3, 3))
    found = fast.geometric_circle(xy, index, n, np.inf, circle, np.empty((3, 3)), C)
    expected, expected_squares, expected_C = slow.geometric(xy)
    np.testing.assert_allclose(circle, expected, atol=1e-5)
    assert found == pytest.approx(expected_squares, rel=1e-6)
    np.testing.assert_allclose(C, expected_C, rtol=1e-3)
    assert fast.arc_extent(xy, index, n, circle) == pytest.approx(slow.extent(xy, circle))
    assert fast.two_line_squares(xy, index, n) == pytest.approx(slow.two_lines(xy), rel=1e-6)
    fast.measured_covariance(xy, index, n, SIGMA, circle, found, C)
    np.testing.assert_allclose(C, slow.covariance(xy, circle, SIGMA), rtol=1e-3)


def test_a_fit_for_anyone() -> None:
    angles = np.linspace(0.0, 2.0, 20)
    found = fit_circle(np.column_stack([1.0 + 0.5 * np.cos(angles), 2.0 + 0.5 * np.sin(angles)]))
    assert found is not None
    np.testing.assert_allclose(found[:3], [1.0, 2.0, 0.5], atol=1e-9)
    assert fit_circle(np.column_stack([angles, 2.0 * angles])) is None
    assert fit_circle(np.eye(2)) is None


def test_inverses_of_symmetric_matrices() -> None:
    rng, out = np.random.default_rng(3), np.empty((3, 3))
    for _ in range(20):
        root = rng.normal(size=(3, 3))
        A = root @ root.T + 0.1 * np.eye(3)
        assert fast.invert3(A, out)
        np.testing.assert_allclose(out, np.linalg.inv(A), rtol=1e-6, atol=1e-9)
    assert not fast.invert3(np.ones((3, 3)), out)


@pytest.mark.parametrize("lidar", [sick_lms200(), scanner_360()], ids=["half", "full"])
def test_what_is_tried_at_all(lidar: Lidar) -> None:
    """Small bent surfaces and runs of chords, in a furnished floor and in a round hall."""
    rng, small, bent = np.random.default_rng(4), 0, 0
    for world in (world_named("office", 2), world_named("office", 3), round_hall(1), round_hall(2)):
        space = FreeSpace.of(world)
        for _ in range(6):
            f = extract_features(lidar.scan(world, space.random_pose(rng), rng))
            spans = np.empty((len(f.points) + 1, 2), dtype=np.int64)
            count = fast.round_clusters(f.points, f.breaks, 7, spans)
            expected = slow.small_and_bent(f.points, f.breaks, 7)
            assert [(int(a), int(b)) for a, b in spans[:count]] == expected
            small += count
            place = np.full(len(f.ranges), -1, dtype=np.int64)
            place[f.beams] = np.arange(len(f.beams))
            count = fast.bent_runs(f.lines, place, spans) if len(f) else 0
            assert [(int(a), int(b)) for a, b in spans[:count]] == slow.runs_of_chords(
                f.lines, place
            )
            bent += count
    assert small > 8
    assert bent > 5


@pytest.mark.parametrize("radius", [0.2, 0.3, 0.5])
def test_columns_are_found_where_they_stand_and_as_sure_as_said(radius: float) -> None:
    rng, squares, radii, missed = np.random.default_rng(6), [], [], 0
    for _ in range(150):
        bearing, d = rng.uniform(-3.0, 3.0), radius + rng.uniform(0.8, 3.5)
        centre = d * np.array([math.cos(bearing), math.sin(bearing)])
        disks = np.array([[*centre, radius]])
        f = extract_features(scanner_360().scan(FAR_WALLS, Pose.identity(), rng, disks=disks))
        assert len(f.circles) <= 1
        missed += 1 - len(f.circles)
        for row in f.circles:
            C = row[[fast.VAR_XX, fast.VAR_XY, fast.VAR_XY, fast.VAR_YY]].reshape(2, 2)
            e = row[[fast.CX, fast.CY]] - centre
            squares.append(float(e @ np.linalg.solve(C, e)))
            radii.append((row[fast.RADIUS] - radius) ** 2 / row[fast.VAR_RADIUS])
            assert row[fast.SENSE] == COLUMN
            assert math.radians(60.0) <= row[fast.ARC] <= math.pi + 0.1
            assert math.hypot(*e) < 0.1
    assert missed <= 15
    assert 1.4 < np.mean(squares) < 2.6  # chi-squared with two
    assert 0.6 < np.mean(radii) < 1.5


def test_a_round_hall_is_one_circle_though_columns_hide_parts_of_it() -> None:
    rng, here = np.random.default_rng(1), Pose(0.7, -0.4, 0.9)
    f = extract_features(scanner_360().scan(round_hall(3), here, rng))
    rooms = f.circles[f.circles[:, fast.SENSE] == ROOM]
    assert len(rooms) == 1
    centre = here.transform(rooms[0, [fast.CX, fast.CY]])
    np.testing.assert_allclose(centre, 0.0, atol=0.01)
    assert rooms[0, fast.RADIUS] == pytest.approx(6.0, abs=0.01)
    assert rooms[0, fast.ARC] > math.radians(300.0)
    assert np.count_nonzero(f.circles[:, fast.SENSE] == COLUMN) >= 5


@pytest.mark.parametrize("sides", [3, 4, 5])
@pytest.mark.parametrize("lidar", [sick_lms200(), scanner_360()], ids=["half", "full"])
def test_boxes_and_corners_do_not_pose_as_columns(sides: int, lidar: Lidar) -> None:
    rng, found = np.random.default_rng(5), 0
    for _ in range(60):
        plan = Blueprint("box")
        d, bearing = float(rng.uniform(1.2, 4.0)), float(rng.uniform(-1.3, 1.3))
        middle = (d * math.cos(bearing), d * math.sin(bearing))
        plan.pillar(middle, float(rng.uniform(0.25, 0.6)), sides, float(rng.uniform(0.0, 6.0)))
        walls = np.vstack([plan.world().walls, FAR_WALLS.walls])
        found += len(extract_features(lidar.scan(World(walls), Pose.identity(), rng)).circles)
    assert found <= (0 if sides < 5 else 8)


@pytest.mark.parametrize("name", ["rooms", "corridors", "rectangle"])
@pytest.mark.parametrize("lidar", [sick_lms200(), scanner_360()], ids=["half", "full"])
def test_where_nothing_is_round_there_are_no_circles(name: str, lidar: Lidar) -> None:
    world, rng = world_named(name, 3), np.random.default_rng(8)
    space = FreeSpace.of(world)
    scans = [lidar.scan(world, space.random_pose(rng), rng) for _ in range(40)]
    assert sum(len(extract_features(scan).circles) for scan in scans) == 0


def test_small_noisy_clusters_are_no_columns() -> None:
    rng, found = np.random.default_rng(9), 0
    for _ in range(200):
        ranges = np.full(181, np.nan)
        first = int(rng.integers(10, 150))
        ranges[first : first + 12] = 2.0 + rng.normal(0.0, 0.06, 12)
        scan = sick_lms200().scan(rectangle(), Pose(3.0, 2.0, 0.0), rng)
        found += len(extract_features(type(scan).checked(
            ranges, angle_min=scan.angle_min, angle_increment=scan.angle_increment,
            range_min=0.0, range_max=30.0, stamp=0.0,
        )).circles)  # fmt: skip
    assert found <= 2


def test_chords_of_a_circle_and_lines_beside_it() -> None:
    rng = np.random.default_rng(1)
    f = extract_features(scanner_360().scan(round_hall(columns=0), Pose(0.7, 0.0, 0.0), rng))
    assert len(f) > 10
    assert len(f.circles) == 1
    assert len(f.straight()) == 0
    room = extract_features(scanner_360().scan(rectangle(), Pose(3.0, 2.0, 0.0), rng))
    assert room.straight() is room
    circle = np.zeros((1, CIRCLE_COLUMNS))
    circle[0, [fast.CX, fast.CY, fast.RADIUS]] = 3.0, 0.0, 0.3
    for x, is_chord in ((2.7, True), (2.4, False), (3.0, False)):
        line = np.zeros((1, 12))
        line[0, :4] = x, -0.12, x, 0.12
        assert fast.chords(line, circle, 0.09)[0] == is_chord


def test_turning_the_sweep_turns_its_circles() -> None:
    rng = np.random.default_rng(2)
    scan = scanner_360().scan(round_hall(4), Pose(0.3, 0.2, 0.1), rng)
    before = extract_features(scan).circles
    R = Pose(0.0, 0.0, 1.1)
    turned = type(scan).checked(
        scan.ranges, angle_min=scan.angle_min + 1.1, angle_increment=scan.angle_increment,
        range_min=0.0, range_max=30.0, stamp=0.0,
    )  # fmt: skip
    after = extract_features(turned).circles
    assert len(before) == len(after) > 4
    np.testing.assert_allclose(after[:, :2], R.transform(before[:, :2]), atol=1e-6)
    kept = [fast.RADIUS, *range(fast.VAR_RADIUS, CIRCLE_COLUMNS)]
    np.testing.assert_allclose(after[:, kept], before[:, kept], rtol=1e-5, atol=1e-8)
