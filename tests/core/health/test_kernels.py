"""Kernels of the sensor doctor against slow twins in plain numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.features import extract_features
from lineloom_core.features._kernels import FIRST, LAST, LENGTH, OFFSET, THETA
from lineloom_core.health import _kernels as kernels
from lineloom_lab.simulation import Fleet, sick_lms200
from numpy.typing import NDArray

SEEDS = range(5)


def _straightened(values: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(values - np.polyval(np.polyfit(along, values, 1), along))


def test_bulges_are_those_of_a_fit_wall_by_wall() -> None:
    fleet = Fleet.office(seed=3, robots=1, duration_s=2.0, lidar=sick_lms200())
    for simulated in fleet.robots[0].scans():
        features = extract_features(simulated.scan)
        above = below = 0.0
        for line in features.lines:
            inside = (features.beams >= line[FIRST]) & (features.beams <= line[LAST])
            c, s, distance = math.cos(line[THETA]), math.sin(line[THETA]), -line[OFFSET]
            x, y = (features.points[inside] @ np.array([[c, -s], [s, c]])).T
            bearing = np.arctan2(x, distance)
            flat = np.abs(bearing) < 1.3
            if line[LENGTH] < 0.5 or distance < 0.3 or np.count_nonzero(flat) < 10:
                continue
            shape = _straightened(bearing[flat] * x[flat], x[flat])
            above += float(shape @ _straightened(y[flat] + distance, x[flat]))
            below += float(shape @ shape)
        walls = kernels.bulges(features.points, features.beams, features.lines, 0.5, 10, 0.3, 1.3)
        found = tuple(walls.sum(axis=0))
        assert below > 0.0
        assert found == pytest.approx((above, below), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_profile_is_the_mean_of_each_sector(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ranges = np.where(rng.random(250) < 0.6, rng.uniform(1.0, 9.0, 250), np.nan)
    ranges[:40] = np.inf
    angles = -2.9 + 0.02 * np.arange(250)
    sector = np.floor(np.mod(angles / math.tau, 1.0) * 72).astype(int)
    found = kernels.profile(ranges, -2.9, 0.02, 72)
    for k in range(72):
        own = ranges[(sector == k) & np.isfinite(ranges)]
        assert found[k] == pytest.approx(own.mean()) if len(own) else math.isnan(found[k])


@pytest.mark.parametrize("seed", SEEDS)
def test_profiles_are_apart_by_the_mean_at_the_turn_that_fits_best(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a = np.where(rng.random(72) < 0.7, rng.uniform(1.0, 9.0, 72), np.nan)
    b = np.roll(a, 4) + rng.normal(0.0, 0.1, 72)
    least = 1.5
    for shift in range(-6, 7):
        difference = np.minimum(np.abs(a - np.roll(b, shift)), 1.5)
        if np.count_nonzero(np.isfinite(difference)) >= 18:
            least = min(least, float(np.nanmean(difference)))
    assert kernels.profiles_apart(a, b, 6, 1.5, 18) == pytest.approx(least)
    assert least < 0.2
    assert kernels.profiles_apart(a, b, 6, 1.5, 73) == 1.5


@pytest.mark.parametrize("apart", [0, 1, 40])
def test_the_median_step_leaves_out_what_is_not_finite(apart: int) -> None:
    rng = np.random.default_rng(apart)
    ranges = np.where(rng.random(120) < 0.8, rng.uniform(1.0, 9.0, 120), np.inf)
    with np.errstate(invalid="ignore"):
        steps = np.abs(ranges[apart:] - ranges[: len(ranges) - apart]) if apart else ranges
    steps = steps[np.isfinite(steps)]
    assert kernels.median_step(ranges, apart) == (float(np.median(steps)), len(steps))
    assert kernels.median_step(np.full(9, np.nan), apart) == (0.0, 0)
