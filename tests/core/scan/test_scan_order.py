"""The order of the beams: negative increments, inverted mounts, points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lineloom_core.scan import Mount, Scan
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def sweep(ranges: Floats, angle_min: float, increment: float) -> Scan:
    return Scan.checked(
        ranges,
        angle_min=angle_min,
        angle_increment=increment,
        range_min=0.0,
        range_max=30.0,
        stamp=3.0,
        seq=4,
        session="s",
    )


def random_ranges(seed: int, n: int = 40) -> Floats:
    rng = np.random.default_rng(seed)
    ranges = rng.uniform(0.5, 20.0, n)
    ranges[rng.random(n) < 0.2] = math.nan
    ranges[rng.random(n) < 0.1] = math.inf
    return ranges


def sorted_points(points: Floats) -> Floats:
    ordered: Floats = points[np.lexsort(points.T.round(9))]
    return ordered


sweeps = st.builds(
    lambda seed, start, step: sweep(random_ranges(seed), start, step),
    st.integers(0, 50),
    st.floats(-3.0, 3.0),
    st.sampled_from([0.1, -0.1, 0.02, -0.15]),
)


@given(sweeps)
def test_points_lie_where_the_beams_point(scan: Scan) -> None:
    expected = [
        (r * math.cos(a), r * math.sin(a))
        for i, r in enumerate(scan.ranges.tolist())
        if math.isfinite(r)
        for a in [scan.angle_min + i * scan.angle_increment]
    ]
    np.testing.assert_allclose(scan.points(), np.array(expected).reshape(-1, 2), atol=1e-9)


@given(sweeps)
def test_counter_clockwise_changes_the_order_and_nothing_else(scan: Scan) -> None:
    turned = scan.counter_clockwise()
    assert turned.angle_increment > 0.0
    assert turned.ranges.flags.c_contiguous
    np.testing.assert_allclose(
        sorted_points(turned.points()), sorted_points(scan.points()), atol=1e-9
    )
    assert (turned.seq, turned.session, turned.stamp) == (scan.seq, scan.session, scan.stamp)
    again = turned.counter_clockwise()
    np.testing.assert_array_equal(again.ranges, turned.ranges)
    assert again.angle_min == turned.angle_min


@given(sweeps)
def test_an_inverted_lidar_sees_the_mirror_image(scan: Scan) -> None:
    upright = scan.counter_clockwise(inverted=True)
    assert upright.angle_increment > 0.0
    np.testing.assert_allclose(
        sorted_points(upright.points()), sorted_points(scan.points() * [1.0, -1.0]), atol=1e-9
    )


@given(sweeps)
def test_inverting_twice_gives_the_sweep_itself(scan: Scan) -> None:
    once = scan.counter_clockwise(inverted=True)
    twice = once.counter_clockwise(inverted=True)
    plain = scan.counter_clockwise()
    np.testing.assert_array_equal(twice.ranges, plain.ranges)
    assert twice.angle_min == pytest.approx(plain.angle_min, abs=1e-12)
    assert twice.angle_increment == plain.angle_increment


def test_a_clockwise_sweep_is_the_reversed_counter_clockwise_one() -> None:
    ranges = random_ranges(3)
    forth = sweep(ranges, -1.0, 0.05)
    back = sweep(ranges[::-1], -1.0 + 0.05 * 39, -0.05).counter_clockwise()
    np.testing.assert_array_equal(back.ranges, forth.ranges)
    assert back.angle_min == pytest.approx(forth.angle_min)


def test_a_sweep_that_is_counter_clockwise_already_shares_its_ranges() -> None:
    scan = sweep(random_ranges(1), -1.0, 0.05)
    assert scan.counter_clockwise().ranges is scan.ranges


def test_angles_are_not_wrapped() -> None:
    scan = sweep(np.ones(10), 3.0, 0.1)
    np.testing.assert_allclose(scan.angles, 3.0 + 0.1 * np.arange(10))
    assert scan.angles[-1] > math.pi


def test_a_mount_is_upright_at_the_base_unless_told() -> None:
    assert not Mount().inverted
    np.testing.assert_array_equal(Mount().T_base_laser.to_array(), np.zeros(3))
