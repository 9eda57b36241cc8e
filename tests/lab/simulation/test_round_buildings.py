"""Worlds of round things are as round, as free and as reproducible as they say."""

from __future__ import annotations

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import Lidar, column_corridor, round_hall

EXACT = Lidar(-3.0, 0.01, 600, range_sigma=0.0)


def test_a_hall_is_round_from_its_middle() -> None:
    ranges = EXACT.exact_ranges(round_hall(columns=0), Pose.identity())
    assert np.all((ranges > 6.0 - 0.01) & (ranges <= 6.0 + 1e-9))
    hall = round_hall(3, radius=7.0, columns=5)
    assert len(hall.walls) == 64 + 5 * 32
    assert hall.is_free(0.0, 0.0, 2.3)


def test_the_same_seed_is_the_same_world_and_another_is_another() -> None:
    for build in (column_corridor, round_hall):
        np.testing.assert_array_equal(build(4).walls, build(4).walls)
        assert not np.array_equal(build(4).walls[-32:], build(5).walls[-32:])


def test_columns_stand_between_the_walls_or_alone() -> None:
    corridor = column_corridor(1)
    x_min, y_min, x_max, y_max = corridor.bounds
    assert (x_min, y_min, x_max, y_max) == (-40.0, 0.0, 40.0, 4.0)
    bare = column_corridor(1, walls=False)
    np.testing.assert_array_equal(corridor.walls[2:], bare.walls)
    centres = bare.walls.reshape(-1, 32, 4)[:, :, :2].mean(axis=1)
    assert len(centres) > 25
    assert np.all((centres[:, 1] > 0.3) & (centres[:, 1] < 3.7))
    steps = np.diff(centres[:, 0])
    assert np.all((steps >= 1.0) & (steps <= 2.4))
    assert np.std(steps) > 0.2
