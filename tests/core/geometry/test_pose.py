"""Poses: the laws of the group SE(2), against 3x3 matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lineloom_core.geometry import Pose, wrap
from numpy.typing import NDArray

metres = st.floats(-100.0, 100.0)
poses = st.builds(Pose, metres, metres, st.floats(-math.pi, math.pi))


def matrix(T: Pose) -> NDArray[np.float64]:
    c, s = math.cos(T.theta), math.sin(T.theta)
    return np.array([[c, -s, T.x], [s, c, T.y], [0.0, 0.0, 1.0]])


def assert_same(a: Pose, b: Pose) -> None:
    np.testing.assert_allclose(matrix(a), matrix(b), atol=1e-9)


@given(poses, poses)
def test_composition_is_the_product_of_matrices(a: Pose, b: Pose) -> None:
    np.testing.assert_allclose(matrix(a @ b), matrix(a) @ matrix(b), atol=1e-9)
    assert -math.pi < (a @ b).theta <= math.pi


@given(poses, poses, poses)
def test_composition_is_associative(a: Pose, b: Pose, c: Pose) -> None:
    assert_same((a @ b) @ c, a @ (b @ c))


@given(poses)
def test_the_identity_and_the_inverse(a: Pose) -> None:
    assert_same(a @ Pose.identity(), a)
    assert_same(Pose.identity() @ a, a)
    np.testing.assert_allclose(matrix(a.inverse()), np.linalg.inv(matrix(a)), atol=1e-9)
    assert_same(a.inverse().inverse(), a)


@given(poses, poses)
def test_between_leads_from_one_to_the_other(a: Pose, b: Pose) -> None:
    assert_same(a @ a.between(b), b)
    assert_same(a.between(b), b.between(a).inverse())


@given(poses, poses, st.lists(st.tuples(metres, metres), min_size=1, max_size=8))
def test_points_are_moved_as_the_names_say(
    T_a_b: Pose, T_b_c: Pose, points: list[tuple[float, float]]
) -> None:
    p = np.array(points)
    homogeneous = np.column_stack([p, np.ones(len(p))])
    np.testing.assert_allclose(
        T_a_b.transform(p), (homogeneous @ matrix(T_a_b).T)[:, :2], atol=1e-9
    )
    np.testing.assert_allclose(
        (T_a_b @ T_b_c).transform(p), T_a_b.transform(T_b_c.transform(p)), atol=1e-8
    )


@given(poses)
def test_no_points_stay_no_points(a: Pose) -> None:
    assert a.transform(np.empty((0, 2))).shape == (0, 2)


@given(poses, st.tuples(metres, metres, st.floats(-2.0, 2.0)))
def test_the_adjoint_carries_a_twist_from_source_to_target(
    a: Pose, twist: tuple[float, float, float]
) -> None:
    vx, vy, w = twist
    hat = np.array([[0.0, -w, vx], [w, 0.0, vy], [0.0, 0.0, 0.0]])
    carried = matrix(a) @ hat @ np.linalg.inv(matrix(a))
    np.testing.assert_allclose(
        a.adjoint() @ twist, [carried[0, 2], carried[1, 2], carried[1, 0]], atol=1e-8
    )


@given(poses)
def test_arrays_go_there_and_back(a: Pose) -> None:
    array = a.to_array()
    assert array.dtype == np.float64
    assert Pose.from_array(array) == a
    with pytest.raises(ValueError, match="unpack"):
        Pose.from_array([1.0, 2.0])


@given(poses, poses, poses)
def test_distance_is_the_same_in_every_frame(a: Pose, b: Pose, moved: Pose) -> None:
    assert a.distance(b) == pytest.approx((moved @ a).distance(moved @ b), abs=1e-8)
    assert a.distance(b) == pytest.approx(math.dist((a.x, a.y), (b.x, b.y)))


def test_the_inverse_of_half_a_turn_stays_in_the_half_open_turn() -> None:
    assert Pose(0.0, 0.0, math.pi).inverse().theta == wrap(-math.pi) == math.pi
