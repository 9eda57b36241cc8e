"""Laws of the information that constraints carry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.facts.information import (
    INDEPENDENT_SHARE,
    observed_information,
    step_information,
    turned,
)
from numpy.typing import NDArray

angles = st.floats(-math.pi, math.pi)
seeds = st.integers(0, 10_000)


def information(seed: int, scale: float = 1e5) -> NDArray[np.float64]:
    """A random positive definite matrix."""
    A = np.random.default_rng(seed).normal(size=(3, 3))
    return scale * (A @ A.T + 0.05 * np.eye(3))


def corridor(direction: float) -> NDArray[np.float64]:
    """Walls along `direction` only: nothing is known of the way along them."""
    return turned(np.diag([0.0, 4e5, 2e6]), -direction)


def is_information(matrix: NDArray[np.float64]) -> bool:
    scale = float(np.abs(matrix).max())
    return bool(
        np.array_equal(matrix, matrix.T) and np.linalg.eigvalsh(matrix).min() > -1e-9 * scale
    )


@settings(max_examples=60, deadline=None)
@given(seeds, angles, angles)
def test_turning_is_a_group_action_that_keeps_the_eigenvalues(
    seed: int, a: float, b: float
) -> None:
    I = information(seed)  # noqa: E741
    np.testing.assert_allclose(turned(turned(I, a), b), turned(I, a + b), rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(
        np.linalg.eigvalsh(turned(I, a)), np.linalg.eigvalsh(I), rtol=1e-6, atol=1e-3
    )
    assert turned(I, a)[2, 2] == pytest.approx(I[2, 2])


def test_a_quarter_turn_swaps_the_axes() -> None:
    # Known across x in the map; axes that look along the map's y see that along their -x... x.
    np.testing.assert_allclose(
        turned(np.diag([1.0, 2.0, 3.0]), math.pi / 2), np.diag([2.0, 1.0, 3.0]), atol=1e-12
    )


@settings(max_examples=60, deadline=None)
@given(seeds, angles)
def test_an_error_costs_the_same_in_either_axes(seed: int, angle: float) -> None:
    I = information(seed)  # noqa: E741
    error = np.random.default_rng(seed + 1).normal(size=3)
    c, s = math.cos(angle), math.sin(angle)
    seen = np.array(
        [c * error[0] + s * error[1], -s * error[0] + c * error[1], error[2]]
    )  # R^T e: the same error in axes turned by `angle`
    assert seen @ turned(I, angle) @ seen == pytest.approx(error @ I @ error, rel=1e-6)


@settings(max_examples=60, deadline=None)
@given(seeds, st.floats(0.0, 7.0))
def test_a_step_is_never_surer_than_the_points_and_the_lidar(seed: int, log_scale: float) -> None:
    made = step_information(information(seed, 10.0**log_scale), (0.15, 0.05))
    assert is_information(made)
    floor = np.diag([0.006**-2, 0.006**-2, 0.002**-2])
    assert np.linalg.eigvalsh(floor - made).min() > -1e-6 * floor.max()


@settings(max_examples=60, deadline=None)
@given(angles)
def test_a_step_in_a_corridor_still_holds_the_robot_by_the_motion_prior(direction: float) -> None:
    made = step_information(corridor(direction), (0.15, 0.05))
    along = np.array([math.cos(direction), math.sin(direction), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    # Along: 15 cm of the prior and the 6 mm of the floor, nothing else.
    assert along @ made @ along == pytest.approx(1.0 / (0.15**2 + 0.006**2), rel=1e-6)
    assert across @ made @ across > 100.0 * (along @ made @ along)


@settings(max_examples=60, deadline=None)
@given(seeds, st.floats(1.0, 100.0))
def test_more_seen_is_never_less_sure(seed: int, factor: float) -> None:
    I = information(seed)  # noqa: E741
    for made, more in (
        (step_information(I, (0.15, 0.05)), step_information(factor * I, (0.15, 0.05))),
        (observed_information(I), observed_information(factor * I)),
    ):
        assert np.linalg.eigvalsh(more - made).min() > -1e-6 * np.abs(more).max()


@settings(max_examples=60, deadline=None)
@given(angles)
def test_a_loop_in_a_corridor_says_nothing_about_the_way_along(direction: float) -> None:
    made = observed_information(corridor(direction))
    assert is_information(made)
    along = np.array([math.cos(direction), math.sin(direction), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    np.testing.assert_allclose(made @ along, 0.0, atol=1e-6)
    seen = INDEPENDENT_SHARE * 4e5
    assert across @ made @ across == pytest.approx(1.0 / (1.0 / seen + 0.006**2), rel=1e-6)


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_where_all_is_seen_a_loop_is_the_sum_of_both_covariances(seed: int) -> None:
    # Strong enough that no direction is weak: then (S^-1 + F)^-1, which the formula avoids.
    I = information(seed, 1e6) + 1e6 * np.eye(3)  # noqa: E741
    floor = np.diag([0.006**2, 0.006**2, 0.002**2])
    expected = np.linalg.inv(np.linalg.inv(INDEPENDENT_SHARE * I) + floor)
    np.testing.assert_allclose(observed_information(I), expected, rtol=1e-6, atol=1e-3)


def test_nothing_seen_is_nothing_said() -> None:
    np.testing.assert_array_equal(observed_information(np.zeros((3, 3))), np.zeros((3, 3)))


def test_a_moved_constraint_keeps_what_was_measured() -> None:
    first = Constraint(
        "k1", "loop", "candidate", 3, 7, Pose(1, 2, 0.5), np.eye(3), "new", {"fit": 0.9}
    )
    kept = first.moved_to("accepted", "two agree", consistency_set=("k1", "k2"))
    gone = kept.moved_to("rejected", "contradicted")
    assert (first.state, kept.state, gone.state) == ("candidate", "accepted", "rejected")
    assert (gone.reason, gone.consistency_set) == ("contradicted", ("k1", "k2"))
    assert (gone.T_a_b, gone.checks, gone.keyframe_b) == (first.T_a_b, first.checks, 7)
    assert first.edge().robust
    step = Constraint("k2", "sequential", "accepted", 0, 1, Pose(0, 0, 0), np.eye(3), "")
    assert not step.edge().robust  # nothing else can vouch for a robot's own steps
