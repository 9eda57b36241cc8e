"""The search for a scan that may be anywhere around: compiled steps, slow twins, laws."""

from __future__ import annotations

import itertools
import math
from functools import cache

import numpy as np
import pytest
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose, angle_difference, wrap
from lineloom_core.matching import _wide_search_kernels as fast
from lineloom_core.matching.local_map import Cloud, LocalMap
from lineloom_lab.simulation import World, scanner_360
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PITCH = fast.COARSE
L_ROOM = World(
    np.array(
        [
            *([0, 0, 9, 0], [9, 0, 9, 4], [9, 4, 5, 4], [5, 4, 5, 7], [5, 7, 0, 7], [0, 7, 0, 0]),
            *([2, 5.5, 3, 5.5], [3, 5.5, 3, 6], [7, 1, 7.6, 1.6], [0, 3, 0.6, 3]),
        ],
        dtype=float,
    )
)
"""An L with a table, a pillar and a shelf: like itself in no other place and turn."""
FIRST = Pose(3.4, 2.6, 0.3)


@cache
def seen_from(pose: Pose, seed: int = 0) -> Cloud:
    scan = scanner_360().scan(L_ROOM, pose, np.random.default_rng(seed))
    return Cloud.of(extract_features(scan))


def slow_field(surface: Floats, corner: tuple[float, float], shape: tuple[int, int]) -> Floats:
    """Of all surfaces at most two cells away, what the nearest is worth."""
    field = np.zeros(shape)
    for a, b in np.ndindex(shape):
        for x, y in surface[:, :2].tolist():
            cell = math.floor((x - corner[0]) / PITCH), math.floor((y - corner[1]) / PITCH)
            if max(abs(a - cell[0]), abs(b - cell[1])) <= 2:
                centre = corner[0] + (a + 0.5) * PITCH, corner[1] + (b + 0.5) * PITCH
                away = math.dist(centre, (x, y)) / fast.SPREAD
                field[a, b] = max(float(field[a, b]), int(255.0 * math.exp(-0.5 * away**2)))
    return field


def slow_search(
    field: Floats, corner: tuple[float, float], points: Floats, guess: Pose, reach: float,
    turns: int, per_turn: int,
) -> Floats:  # fmt: skip
    """Try every heading and position; of one heading no two next to each other."""
    k = math.ceil(reach / PITCH)
    shifts = list(itertools.product(range(-k, k + 1), repeat=2))
    rows = []
    for t in range(turns):
        turned = Pose(guess.x, guess.y, guess.theta + 2.0 * math.pi * t / turns)
        cells = [
            (math.floor((x - corner[0]) / PITCH), math.floor((y - corner[1]) / PITCH))
            for x, y in turned.transform(points)
        ]
        cells = [
            c for c in cells
            if all(k <= c[d] < field.shape[d] - k for d in range(2))
        ]  # fmt: skip
        value = {
            (a, b): sum(float(field[x + a, y + b]) for x, y in cells) / (255.0 * len(points))
            for a, b in shifts
        }
        for _ in range(per_turn):
            if not value:
                break
            a, b = max(value, key=lambda s: value[s])  # the first of equals
            at = guess.x + a * PITCH, guess.y + b * PITCH
            rows.append((*at, wrap(turned.theta), value[a, b]))
            value = {s: v for s, v in value.items() if max(abs(s[0] - a), abs(s[1] - b)) > 1}
    return np.array(rows)


def on_a_small_map(seed: int) -> tuple[Floats, NDArray[np.uint8], Floats]:
    """Random surfaces with its coarse field, from (-1, -2) on, and random points of a scan."""
    rng = np.random.default_rng(seed)
    surface = np.zeros((25, 5))
    surface[:, :2] = rng.uniform((-1.0, -2.0), (4.0, 2.0), (25, 2))
    field = fast.coarse_field(surface, -1.0, -2.0, 20, 16)
    return surface, field, rng.uniform(-1.5, 1.5, (12, 2))


@pytest.mark.parametrize("seed", range(4))
def test_the_coarse_field_is_worth_the_nearest_surface(seed: int) -> None:
    surface, field, _ = on_a_small_map(seed)
    slow = slow_field(surface, (-1.0, -2.0), (20, 16))
    np.testing.assert_allclose(field, slow, atol=2.0)  # distances are looked up by hundredths
    assert field.max() > 200


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("per_turn", [1, 3])
def test_the_coarse_search_tries_them_all(seed: int, per_turn: int) -> None:
    _, field, points = on_a_small_map(seed)
    middle = (2.6, 0.6) if seed % 2 else (0.2, -0.6)  # some points leave the field at each end
    guess, corner = Pose(*middle, 0.7 * seed), (-1.0, -2.0)
    found = fast.search_coarsely(field, *corner, points, guess.to_array(), 0.7, 9, per_turn)
    expected = slow_search(field.astype(np.float64), corner, points, guess, 0.7, 9, per_turn)
    np.testing.assert_allclose(found[:, 3], expected[:, 3], atol=1e-12)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert found[:, 3].max() > 0.1


def test_points_that_could_leave_the_field_count_for_nothing() -> None:
    _, field, points = on_a_small_map(0)
    far = np.array([[50.0, 0.0]])
    guess = np.array([1.4, 0.1, 0.0])
    few = fast.search_coarsely(field, -1.0, -2.0, points, guess, 0.5, 5, 1)
    more = fast.search_coarsely(field, -1.0, -2.0, np.vstack([points, far]), guess, 0.5, 5, 1)
    np.testing.assert_array_equal(more[:, :3], few[:, :3])
    np.testing.assert_allclose(more[:, 3], few[:, 3] * len(points) / (len(points) + 1))


def off(a: Pose, b: Pose) -> tuple[float, float]:
    return a.distance(b), abs(angle_difference(a.theta, b.theta))


@pytest.mark.parametrize("degrees", range(-175, 180, 35))
def test_a_scan_is_found_however_it_is_turned(degrees: int) -> None:
    true = Pose(4.4, 1.7, math.radians(degrees))
    built = LocalMap.build([(seen_from(FIRST), FIRST)])
    found = built.search_around(seen_from(true, 1), FIRST, reach=2.0, most=4)
    away, turned = off(found[0], true)
    assert away < 0.12  # the search's own step is 0.1 m
    assert turned < math.radians(2.0)
    settled = built.register(seen_from(true, 1), found[0]).pose
    assert off(settled, true)[0] < 0.03
    assert 1 < len(found) <= 4
    assert all(off(a, b)[0] > 0.2 or off(a, b)[1] > 0.05 for a, b in itertools.pairwise(found))


@pytest.mark.parametrize("moved", [Pose(0, 0, 1.1), Pose(-30.3, 7.7, 0), Pose(5.2, -1.1, -2.6)])
def test_where_the_map_lies_does_not_matter(moved: Pose) -> None:
    true = Pose(4.1, 2.0, -2.0)
    here = LocalMap.build([(seen_from(FIRST), FIRST)])
    there = LocalMap.build([(seen_from(FIRST), moved @ FIRST)])
    cloud = seen_from(true, 1)
    expected = here.search_around(cloud, FIRST, reach=2.0, most=1)[0]
    found = there.search_around(cloud, moved @ FIRST, reach=2.0, most=1)[0]
    assert off(found, moved @ expected)[0] < 0.15  # cells lie otherwise: a step of the search
    assert off(found, moved @ expected)[1] < math.radians(2.0)
    settled = there.register(cloud, found).pose
    assert off(settled, moved @ here.register(cloud, expected).pose)[0] < 0.02


def test_a_scan_of_next_to_nothing_is_not_looked_for() -> None:
    built = LocalMap.build([(seen_from(FIRST), FIRST)])
    some = seen_from(FIRST)
    few = Cloud(some.points, some.normals, some.weights, some.sparse[:4])
    assert built.search_around(few, FIRST, reach=1.0, most=4) == []
