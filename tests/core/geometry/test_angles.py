"""Angles: the laws of wrapping and of the circular mean."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lineloom_core.geometry import angle_difference, circular_mean, wrap
from lineloom_core.geometry.angles import wrap_array

any_angle = st.floats(-1e4, 1e4)
turns = st.integers(-1000, 1000)


def same_direction(a: float, b: float, tolerance: float = 1e-9) -> bool:
    return math.hypot(math.cos(a) - math.cos(b), math.sin(a) - math.sin(b)) < tolerance


@given(any_angle)
def test_wrapping_keeps_the_direction_and_lands_in_the_half_open_turn(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert same_direction(wrapped, angle)
    assert wrap(wrapped) == wrapped


@given(any_angle, turns)
def test_whole_turns_do_not_matter(angle: float, k: int) -> None:
    assert same_direction(wrap(angle + k * math.tau), wrap(angle))


def test_half_a_turn_is_pi_from_both_sides() -> None:
    assert wrap(math.pi) == math.pi
    assert wrap(-math.pi) == math.pi
    assert wrap(3.0 * math.pi) == pytest.approx(math.pi, abs=1e-12)
    np.testing.assert_array_equal(wrap_array([math.pi, -math.pi]), [math.pi, math.pi])


@given(st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=20))
def test_arrays_are_wrapped_like_numbers(angles: list[float]) -> None:
    wrapped = wrap_array(angles)
    assert wrapped.shape == (len(angles),)
    assert np.all(wrapped > -math.pi - 1e-12)
    assert np.all(wrapped <= math.pi)
    for one, angle in zip(wrapped.tolist(), angles, strict=True):
        assert same_direction(one, wrap(angle))


@given(any_angle, any_angle)
def test_a_difference_is_antisymmetric_and_leads_back(a: float, b: float) -> None:
    d = angle_difference(a, b)
    assert -math.pi < d <= math.pi
    assert same_direction(b + d, a, 1e-7)
    assert same_direction(angle_difference(b, a), -d)


def test_the_difference_across_the_seam_is_the_short_way() -> None:
    near_pi = math.pi - 0.01
    assert angle_difference(near_pi, -near_pi) == pytest.approx(-0.02)
    assert angle_difference(-near_pi, near_pi) == pytest.approx(0.02)


def test_the_mean_of_directions_about_the_seam_lies_on_it() -> None:
    mean = circular_mean([math.pi - 0.1, -math.pi + 0.1])
    assert abs(mean) == pytest.approx(math.pi)  # the plain mean would be 0: the opposite


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=12),
    st.floats(-math.pi, math.pi),
)
def test_turning_all_directions_turns_their_mean(angles: list[float], turn: float) -> None:
    mean = circular_mean(angles)
    assert min(angles) - 1e-9 <= mean <= max(angles) + 1e-9
    turned = circular_mean([a + turn for a in angles])
    assert same_direction(turned, mean + turn)


def test_a_weight_of_two_is_the_same_as_twice() -> None:
    weighted = circular_mean([0.1, 0.7, 2.0], [2.0, 1.0, 1.0])
    assert weighted == pytest.approx(circular_mean([0.1, 0.1, 0.7, 2.0]))
    assert weighted != pytest.approx(circular_mean([0.1, 0.7, 2.0]))


@pytest.mark.parametrize("angles", [[], [0.3, 0.3 + math.pi], [0.0, math.tau / 3, -math.tau / 3]])
def test_directions_that_cancel_have_no_mean(angles: list[float]) -> None:
    with pytest.raises(ValueError, match="cancel"):
        circular_mean(angles)
