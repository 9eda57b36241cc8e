"""Pose and trajectory errors on cases with known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lineloom_core.geometry import Pose
from lineloom_lab.evaluation import (
    DegenerateTrajectoryError,
    align_rigid,
    pose_error,
    trajectory_error,
)
from numpy.typing import NDArray


def moved(T: Pose, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([(T @ Pose.from_array(row)).to_array() for row in rows])


def walk(n: int, seed: int = 0) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return np.column_stack([np.cumsum(rng.normal(0, 0.4, (n, 2)), axis=0), rng.uniform(-3, 3, n)])


@settings(max_examples=50, deadline=None)
@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1), st.integers(0, 1000))
def test_a_rigid_motion_is_found_and_leaves_no_error(
    x: float, y: float, theta: float, seed: int
) -> None:
    estimate = walk(40, seed)
    T = Pose(x, y, theta)
    found = align_rigid(estimate, moved(T, estimate))
    np.testing.assert_allclose(found.to_array(), T.to_array(), atol=1e-6)
    error = trajectory_error(estimate, moved(T, estimate))
    assert error.max < 1e-6
    assert error.rotation_rmse < 1e-6
    assert error.n == 40


def test_alignment_is_the_best_there_is() -> None:
    rng = np.random.default_rng(1)
    truth = walk(60, 1)
    estimate = moved(Pose(1.0, 2.0, 0.5), truth + rng.normal(0, 0.1, truth.shape))
    best = trajectory_error(estimate, truth)
    T = best.T_truth_estimate
    for step in np.concatenate([np.eye(3), -np.eye(3)]) * 0.01:
        other = moved(Pose.from_array(T.to_array() + step), estimate)
        assert trajectory_error(other, truth, align=False).rmse > best.rmse


def test_nan_rows_of_the_reference_are_left_out() -> None:
    truth = walk(30)
    estimate = moved(Pose(1.0, 2.0, 0.5), truth)
    truth[5:20] = np.nan
    estimate[22, 1] = np.nan
    estimate[10] = 1e6  # nobody knows better
    error = trajectory_error(estimate, truth)
    assert error.n == 14
    assert error.max < 1e-9


def test_figures_by_hand() -> None:
    truth = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 3.0]])
    estimate = truth + np.array([[0.0, 0.3, 0.1], [0.0, 0.0, 0.0], [0.4, 0.0, 0.1]])
    error = trajectory_error(estimate, truth, align=False)
    assert error.rmse == pytest.approx(math.sqrt(0.25 / 3))
    assert error.max == pytest.approx(0.4)
    assert error.mean == pytest.approx(0.7 / 3)
    assert error.rotation_rmse == pytest.approx(math.sqrt(0.02 / 3))


def test_degenerate_cases_are_named() -> None:
    with pytest.raises(DegenerateTrajectoryError, match="at least 2"):
        align_rigid(walk(1), walk(1))
    with pytest.raises(DegenerateTrajectoryError, match="coincide"):
        align_rigid(np.zeros((5, 3)), walk(5))
    with pytest.raises(DegenerateTrajectoryError, match="no common"):
        trajectory_error(np.full((3, 3), np.nan), walk(3), align=False)
    with pytest.raises(ValueError, match="shape"):
        align_rigid(walk(3), walk(4))


def test_pose_error_and_its_parts() -> None:
    error = pose_error(Pose(3.0, 4.0, 3.1), Pose(0.0, 0.0, -3.1))
    assert error.translation == pytest.approx(5.0)
    assert error.rotation == pytest.approx(math.tau - 6.2)
    assert error.along(0.0) == pytest.approx(3.0)
    assert error.across(0.0) == pytest.approx(4.0)
    assert error.across(math.atan2(4.0, 3.0)) == pytest.approx(0.0, abs=1e-12)
