"""The local map and registration against it: compiled steps, slow twins, known offsets."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose, wrap
from lineloom_core.matching import _registration_kernels as fast
from lineloom_core.matching.local_map import Cloud, LocalMap
from lineloom_lab.simulation import FreeSpace, World, scanner_360, sick_lms200, world_named
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CELL = 0.1
REACH = 18.0
ALL = np.ones(4, dtype=np.bool_)
Surface = dict[tuple[int, int], list[float]]


@pytest.fixture(scope="module")
def clouds() -> list[tuple[Cloud, Pose]]:
    """Three scans around one spot of a furnished floor, and where they were taken."""
    world, rng = world_named("office", 1), np.random.default_rng(1)
    here = FreeSpace.of(world).random_pose(rng)
    poses = [Pose.identity(), Pose(0.1, -0.05, 0.4), Pose(-0.1, 0.1, -0.7)]
    scans = [sick_lms200().scan(world, here @ pose, rng) for pose in poses]
    return [(Cloud.of(extract_features(s)), p) for s, p in zip(scans, poses, strict=True)]


def cell_of(p: Floats, corner: tuple[float, float]) -> tuple[int, int]:
    return math.floor((p[0] - corner[0]) / CELL), math.floor((p[1] - corner[1]) / CELL)


def slow_insert(surface: Surface, cell: tuple[int, int], p: Floats, n: Floats) -> None:
    """The mean of the points of a cell whose normals agree; a normal is worth more than none."""
    if cell not in surface:
        surface[cell] = [*p, *n, 1.0]
        return
    x, y, nx, ny, w = surface[cell]
    has, known = bool(np.any(n != 0.0)), (nx, ny) != (0.0, 0.0)
    if has and not known:
        surface[cell] = [*p, *n, 1.0]
        return
    if known and (not has or nx * n[0] + ny * n[1] < 0.7):
        return
    mean = np.array([x, y]) + (p - [x, y]) / (w + 1.0)
    turned = w * np.array([nx, ny]) + n
    if has:
        turned /= np.linalg.norm(turned)
    surface[cell] = [*mean, *turned, min(w + 1.0, 20.0)]


def slow_surface(clouds: list[tuple[Cloud, Pose]], corner: tuple[float, float]) -> Surface:
    surface: Surface = {}
    for cloud, pose in clouds:
        turn = Pose(0.0, 0.0, pose.theta)
        for p, n in zip(cloud.points, cloud.normals, strict=True):
            if math.hypot(*p) <= REACH:
                at = pose.transform(p)
                slow_insert(surface, cell_of(at, corner), at, turn.transform(n))
    return surface


def test_every_cell_keeps_the_mean_of_its_points(clouds: list[tuple[Cloud, Pose]]) -> None:
    built = LocalMap.build(clouds)
    expected = slow_surface(clouds, (built.ox, built.oy))
    assert len(built.surface) == len(expected)
    assert max(row[4] for row in expected.values()) >= 3.0
    for (x, y), row in expected.items():
        np.testing.assert_allclose(built.surface[built.index[x, y]], row, atol=1e-9)


def test_a_cell_trusts_the_first_normal_and_one_more_than_none() -> None:
    index, surface = np.full((2, 2), -1, dtype=np.int32), np.empty((4, 5))
    expected: Surface = {}
    up, down, none = [0.0, 1.0], [0.0, -1.0], [0.0, 0.0]
    given = [(0.02, none), (0.05, none), (0.03, up), (0.07, none), (0.09, down), (0.04, up)]
    used = 0
    for x, n in given:
        p, normal = np.array([[x, 0.05]]), np.array([n])
        used = fast.insert_points(
            index, surface, used, 0.0, 0.0, p, normal, ALL[:1], np.zeros(3), REACH
        )
        slow_insert(expected, (0, 0), p[0], normal[0])
    np.testing.assert_allclose(surface[:used], list(expected.values()))
    np.testing.assert_allclose(surface[0], [0.035, 0.05, 0.0, 1.0, 2.0])


def test_a_map_of_some_points_is_that_of_clouds_that_have_no_others(
    clouds: list[tuple[Cloud, Pose]],
) -> None:
    rng = np.random.default_rng(3)
    masks = [rng.random(len(cloud.points)) < 0.6 for cloud, _ in clouds]
    built = LocalMap.build(clouds, kept=np.concatenate(masks))
    less = [(cloud.only(m), pose) for (cloud, pose), m in zip(clouds, masks, strict=True)]
    expected = LocalMap.build(less)
    np.testing.assert_array_equal(built.surface, expected.surface)
    np.testing.assert_array_equal(built.index, expected.index)
    np.testing.assert_array_equal(built.field, expected.field)
    assert (built.ox, built.oy) == (expected.ox, expected.oy)


def test_points_beyond_reach_or_grid_are_left_out() -> None:
    index, surface = np.full((5, 5), -1, dtype=np.int32), np.empty((4, 5))
    points = np.array([[0.25, 0.25], [-0.01, 0.2], [0.2, 0.51], [0.45, 0.45]])
    normals = np.zeros((4, 2))
    used = fast.insert_points(index, surface, 0, 0.0, 0.0, points, normals, ALL, np.zeros(3), 0.5)
    assert used == 1
    np.testing.assert_array_equal(np.argwhere(index >= 0), [[2, 2]])
    box = np.array([np.inf, np.inf, -np.inf, -np.inf])
    fast.bounds(points, ALL, np.array([1.0, 2.0, math.pi / 2]), 0.6, box)
    np.testing.assert_allclose(box, [0.49, 1.99, 0.8, 2.25])


def test_the_field_falls_with_the_distance_to_the_nearest_surface(
    clouds: list[tuple[Cloud, Pose]],
) -> None:
    built = LocalMap.build(clouds)
    cells = np.argwhere(built.index >= 0)
    expected = np.zeros(built.field.shape)
    for a, b in np.ndindex(built.field.shape):
        apart = np.abs(cells - [a, b])
        near = apart[apart.max(axis=1) <= 2]
        if len(near):
            d = CELL * np.hypot(*near.T).min()
            expected[a, b] = math.floor(255.0 * math.exp(-0.5 * (d / 0.12) ** 2))
    np.testing.assert_array_equal(built.field, expected)


@pytest.mark.parametrize(("spacing", "most"), [(0.12, 90), (0.3, 20), (0.0, 7)])
def test_thinning(clouds: list[tuple[Cloud, Pose]], spacing: float, most: int) -> None:
    points = clouds[0][0].points
    kept = [0]
    for k in range(1, len(points)):
        if np.linalg.norm(points[k] - points[kept[-1]]) >= spacing:
            kept.append(k)
    expected = kept[:: max(1, math.ceil(len(kept) / most))]
    np.testing.assert_array_equal(fast.thin(points, spacing, most), expected)
    assert len(expected) <= most


def slow_correlate(
    built: LocalMap, points: Floats, guess: Pose, reach: tuple[float, float],
    step: tuple[float, float], pull: float,
) -> tuple[Floats, float]:  # fmt: skip
    best, winner = -math.inf, np.zeros(3)
    shifts = np.arange(-math.ceil(reach[0] / step[0]), math.ceil(reach[0] / step[0]) + 1) * step[0]
    turns = np.arange(-math.ceil(reach[1] / step[1]), math.ceil(reach[1] / step[1]) + 1) * step[1]
    for turn in turns:
        for dx in shifts:
            for dy in shifts:
                moved = Pose(guess.x + dx, guess.y + dy, guess.theta + turn)
                cells = [cell_of(p, (built.ox, built.oy)) for p in moved.transform(points)]
                inside = [c for c in cells if 0 <= c[0] < built.field.shape[0]
                          and 0 <= c[1] < built.field.shape[1]]  # fmt: skip
                score = sum(float(built.field[c]) for c in inside) / (255.0 * len(points))
                score -= pull * ((turn / reach[1]) ** 2 + (dx**2 + dy**2) / reach[0] ** 2)
                if score > best:
                    best, winner = score, moved.to_array()
    return winner, best


@pytest.mark.parametrize("pull", [0.0, 0.3])
def test_the_search_finds_the_best_of_all(clouds: list[tuple[Cloud, Pose]], pull: float) -> None:
    built = LocalMap.build(clouds[:1])
    cloud, true = clouds[1]
    guess = true @ Pose(0.12, -0.09, 0.05)
    points = cloud.sparse[::3].copy()
    found = fast.correlate(
        built.field, built.ox, built.oy, points, guess.to_array(), 0.2, 0.1, 0.1, 0.05, pull
    )
    pose, score = slow_correlate(built, points, guess, (0.2, 0.1), (0.1, 0.05), pull)
    np.testing.assert_allclose(found, [*pose, score], atol=1e-9)


def test_a_pull_keeps_the_guess_where_nothing_is_to_be_seen(
    clouds: list[tuple[Cloud, Pose]],
) -> None:
    built, guess = LocalMap.build(clouds), Pose(500.0, 0.0, 0.3)
    pose, score = built.search(clouds[0][0], guess, reach_xy=0.4, reach_theta=0.2)
    assert pose == guess
    assert score == 0.0


@pytest.mark.parametrize("off", [Pose(0.4, -0.3, 0.2), Pose(-0.5, 0.1, -0.35)])
def test_search_and_registration_recover_a_known_offset(
    clouds: list[tuple[Cloud, Pose]], off: Pose
) -> None:
    built = LocalMap.build(clouds[:1])
    for cloud, true in clouds[1:]:
        pose, score = built.search(cloud, true @ off, reach_xy=0.6, reach_theta=0.4)
        assert score > 0.3
        error = true.between(built.register(cloud, pose).pose)
        assert math.hypot(error.x, error.y) < 0.03
        assert abs(error.theta) < 0.01


@pytest.fixture(scope="module")
def room() -> tuple[LocalMap, Cloud]:
    """A room seen all around, without noise."""
    world = World(np.array([[0, 0, 7, 0], [7, 0, 7, 4], [7, 4, 0, 4], [0, 4, 0, 0]], dtype=float))
    lidar = scanner_360()
    scan = lidar.scan(world, Pose(3.1, 1.7, 0.4), np.random.default_rng(0))
    cloud = Cloud.of(extract_features(scan))
    return LocalMap.build([(cloud, Pose(3.1, 1.7, 0.4))]), cloud


def test_registration_of_a_cloud_on_itself_is_exact_and_sure(room: tuple[LocalMap, Cloud]) -> None:
    built, cloud = room
    found = built.register(cloud, Pose(3.0, 1.75, 0.43))
    error = Pose(3.1, 1.7, 0.4).between(found.pose)
    assert math.hypot(error.x, error.y) < 0.003
    assert abs(error.theta) < 0.001
    assert found.fit > 0.95
    assert found.rms < 0.02


def test_the_information_is_that_of_numeric_derivatives(room: tuple[LocalMap, Cloud]) -> None:
    """H is the sum over points of w J J^T, J the derivative of the distance to the own surface."""
    built, cloud = room
    sigma = 0.03
    found = built.register(cloud, Pose(3.1, 1.7, 0.4), sigma=sigma, gate=0.15)
    pose = found.pose.to_array()

    def distance(x: Floats, p: Floats, row: Floats) -> float:
        return float(row[2:4] @ (Pose.from_array(x).transform(p) - row[:2]))

    expected, step = np.zeros((3, 3)), 1e-6
    known = built.surface[np.hypot(built.surface[:, 2], built.surface[:, 3]) > 0.5]
    turn = Pose(0.0, 0.0, found.pose.theta)
    for p, n, w in zip(cloud.points, cloud.normals, cloud.weights, strict=True):
        at, normal = found.pose.transform(p), turn.transform(n)
        rows = built.surface
        if np.any(n != 0.0):
            agrees = (rows[:, 2:4] @ normal >= 0.7) | ~np.any(rows[:, 2:4] != 0.0, axis=1)
            rows = rows[agrees]
        row = rows[np.argmin(np.hypot(*(rows[:, :2] - at).T))].copy()
        if not np.any(row[2:4] != 0.0):
            row[2:4] = normal
        e = distance(pose, p, row)
        J = [(distance(pose + d, p, row) - distance(pose - d, p, row)) / (2 * step)
             for d in step * np.eye(3)]  # fmt: skip
        expected += w / sigma**2 / (1.0 + (e / (3.0 * sigma)) ** 2) * np.outer(J, J)
    assert len(known) > 100
    np.testing.assert_allclose(found.information, expected, rtol=0.01, atol=200.0)


def test_a_prior_holds_what_no_wall_fixes() -> None:
    wall = World(np.array([[-20.0, 2.0, 20.0, 2.0]]))
    rng = np.random.default_rng(0)
    clouds = [Cloud.of(extract_features(sick_lms200().scan(wall, Pose(x, 0.0, math.pi / 2), rng)))
              for x in (0.0, 0.3)]  # fmt: skip
    built = LocalMap.build([(clouds[0], Pose(0.0, 0.0, math.pi / 2))])
    guess = Pose(0.5, 0.1, math.pi / 2 + 0.03)
    held = built.register(clouds[1], guess, prior=(1e4, 0.0, 0.0))
    assert held.pose.x == pytest.approx(0.5, abs=0.01)  # along the wall: what the guess said
    assert held.pose.y == pytest.approx(0.0, abs=0.01)
    assert abs(wrap(held.pose.theta - math.pi / 2)) < 0.005
    along, across = held.information[0, 0], held.information[1, 1]
    assert along < 0.01 * across


def test_a_cloud_outside_the_map_matches_nothing(clouds: list[tuple[Cloud, Pose]]) -> None:
    built = LocalMap.build(clouds)
    far = Pose(200.0, 0.0, 0.0)
    found = built.register(clouds[0][0], far)
    assert found.pose == far
    assert (found.matched, found.total, found.fit) == (0.0, 0.0, 0.0)
    assert found.rms == math.inf


def test_a_map_of_nothing_is_still_a_map() -> None:
    nothing = Cloud(np.empty((0, 2)), np.empty((0, 2)), np.empty(0), np.empty((0, 2)))
    built = LocalMap.build([(nothing, Pose.identity())])
    assert len(built.surface) == 0
    assert built.register(nothing, Pose.identity()).fit == 0.0
    assert built.search(nothing, Pose.identity(), reach_xy=0.2, reach_theta=0.1)[0] == Pose(0, 0, 0)
