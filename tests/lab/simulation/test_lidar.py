"""The lidar: what it measures and how wrong it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import Lidar, rectangle, rooms, scanner_360, sick_lms200


def test_the_presets_are_what_their_makers_say() -> None:
    sick, modern = sick_lms200(), scanner_360()
    assert (sick.beams, sick.rate_hz) == (181, 5.0)
    assert sick.angles[0] == pytest.approx(-math.pi / 2)
    assert sick.angles[-1] == pytest.approx(math.pi / 2)
    assert (sick.range_sigma, sick.range_clip) == (0.0125, 0.025)
    assert sick.angle_sigma == pytest.approx(math.radians(0.1))
    assert (modern.beams, modern.range_max) == (1080, 30.0)
    assert modern.angles[-1] + modern.angle_increment == pytest.approx(math.pi)


def test_exact_ranges_in_a_rectangle() -> None:
    lidar = Lidar(0.0, math.pi / 2, 4, range_max=6.0)
    exact = lidar.exact_ranges(rectangle(8.0, 5.0), Pose(1.0, 2.0, math.pi / 2))
    np.testing.assert_allclose(exact, [3.0, 1.0, 2.0, np.inf])


def test_an_inverted_lidar_sweeps_clockwise_and_can_be_turned_back() -> None:
    world, pose = rooms(0), Pose(2.0, 2.5, 0.4)
    lidar = replace(sick_lms200(), range_sigma=0.0, angle_sigma=0.0)
    scan = lidar.scan(world, pose, np.random.default_rng(0), inverted=True)
    righted = scan.counter_clockwise(inverted=True)
    np.testing.assert_allclose(righted.ranges, lidar.exact_ranges(world, pose), atol=1e-9)
    np.testing.assert_allclose(righted.angles, lidar.angles, atol=1e-9)


def test_the_range_noise_has_the_right_spread_and_stops_at_the_clip() -> None:
    lidar = replace(sick_lms200(), angle_sigma=0.0)
    world, pose, rng = rectangle(8.0, 5.0), Pose(4.0, 2.5, 0.1), np.random.default_rng(5)
    exact = lidar.exact_ranges(world, pose)
    errors = np.concatenate([lidar.scan(world, pose, rng).ranges - exact for _ in range(300)])
    assert np.abs(errors).max() <= 0.025 + 1e-12
    assert abs(errors.mean()) < 2e-4
    # A normal cut at two sigma keeps 0.8796 of its standard deviation, and no heap at the cut.
    assert errors.std() == pytest.approx(0.8796 * 0.0125, rel=0.01)
    assert np.mean(np.abs(errors) > 0.0249) < 0.002


def test_the_angular_noise_shows_on_a_slanted_wall() -> None:
    lidar = replace(sick_lms200(), range_sigma=0.0)
    world, pose, rng = rectangle(8.0, 200.0), Pose(4.0, 100.0, 0.0), np.random.default_rng(6)
    errors = [lidar.scan(world, pose, rng).ranges[90 + 60] - 8.0 for _ in range(2000)]
    # rho = d / cos(a): d rho / d a = rho tan(a), at 60 degrees and 8 m.
    assert np.std(errors) == pytest.approx(8.0 * math.tan(math.pi / 3) * math.radians(0.1), rel=0.1)


def test_dropouts_come_as_often_as_asked() -> None:
    lidar = replace(scanner_360(), dropout=0.1)
    scan = lidar.scan(rectangle(), Pose(4.0, 2.5, 0.0), np.random.default_rng(1))
    assert np.isposinf(scan.ranges).mean() == pytest.approx(0.1, abs=0.03)


def test_a_seed_makes_a_scan() -> None:
    world, pose = rooms(1), Pose(2.0, 2.0, 1.0)
    first, again, other = (
        scanner_360().scan(world, pose, np.random.default_rng(seed)).ranges for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_too_near_is_minus_infinity_and_too_far_plus_infinity() -> None:
    lidar = Lidar(0.0, math.pi, 2, range_min=1.0, range_max=6.0, range_sigma=0.0)
    scan = lidar.scan(rectangle(8.0, 5.0), Pose(0.5, 2.0, math.pi), np.random.default_rng(0))
    np.testing.assert_array_equal(scan.ranges, [-np.inf, np.inf])


def test_disks_hide_what_is_behind_them() -> None:
    lidar = Lidar(-0.2, 0.1, 5, range_sigma=0.0)
    disks = np.array([[3.0, 2.0, 0.25], [-3.0, 2.0, 0.25]])
    exact = lidar.exact_ranges(rectangle(), Pose(1.0, 2.0, 0.0), disks=disks)
    assert exact[2] == pytest.approx(1.75)
    np.testing.assert_allclose(exact[[1, 3]], exact[1])
    assert exact[1] < 2.0
    assert exact[0] > 6.9
    swallowed = lidar.exact_ranges(
        rectangle(), Pose(1.0, 2.0, 0.0), disks=np.array([[1.1, 2.0, 0.5]])
    )
    np.testing.assert_array_equal(swallowed, np.zeros(5))


@pytest.mark.parametrize(
    "wrong",
    [
        {"beams": 0},
        {"angle_increment": 0.0},
        {"range_min": 40.0},
        {"range_sigma": -1.0},
        {"range_clip": 0.0},
        {"dropout": 1.5},
        {"rate_hz": 0.0},
    ],
)
def test_impossible_lidars_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must|needs"):
        replace(scanner_360(), **wrong)  # type: ignore[arg-type]
