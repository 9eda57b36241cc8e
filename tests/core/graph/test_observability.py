"""What an information matrix fixes: against a library, and what is known of walls."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.graph import observe, project_out_weak, without_direction
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def informed(*rows: tuple[float, float]) -> Floats:
    """The information of points of walls: of a wall's normal [rad], 2 m along it, so many."""
    H = np.zeros((3, 3))
    for normal, count in rows:
        j = np.array([math.cos(normal), math.sin(normal), 2.0])
        H += count * np.outer(j, j)
        j[2] = -1.0
        H += count * np.outer(j, j)
    return H


def slow_without(H: Floats, u: Floats) -> Floats:
    along = u @ H @ u
    return H if along <= 1e-9 else H - np.outer(H @ u, H @ u) / along


@pytest.mark.parametrize("seed", range(20))
def test_it_says_what_eigenvalues_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    J = rng.normal(0.0, 20.0, (3 if seed % 3 else 2, 3))  # of two rows: one direction is open
    H = J.T @ J
    seen = observe(H)
    translation = slow_without(H, np.eye(3)[2])[:2, :2]
    values, vectors = np.linalg.eigh(translation)
    np.testing.assert_allclose(seen.translation, translation, atol=1e-9)
    np.testing.assert_allclose([seen.lambda_min, seen.lambda_max], values, atol=1e-6)
    least = np.array([math.cos(seen.least_known), math.sin(seen.least_known)])
    assert abs(least @ vectors[:, 0]) == pytest.approx(1.0)
    rotation = H
    for axis in np.linalg.eigh(H[:2, :2])[1].T:
        rotation = slow_without(rotation, np.array([*axis, 0.0]))
    assert seen.rotation == pytest.approx(max(rotation[2, 2], 0.0), abs=1e-6)
    assert seen.weak_translation == int(np.count_nonzero(values < 300.0))
    assert (seen.weak_direction is None) == (seen.weak_translation == 0)
    assert 0.0 <= seen.least_known < math.pi


def test_a_plain_corridor_leaves_its_way_open() -> None:
    along = 0.3
    seen = observe(informed((along + math.pi / 2, 400.0), (along - math.pi / 2, 400.0)))
    assert seen.weak_translation == 1
    assert seen.weak_direction == pytest.approx(along)
    assert not seen.weak_rotation


def test_nothing_known_is_known_nowhere() -> None:
    seen = observe(np.zeros((3, 3)))
    assert seen.weak_translation == 2
    assert seen.weak_rotation
    np.testing.assert_array_equal(project_out_weak(np.zeros((3, 3))), np.zeros((3, 3)))


def test_what_is_projected_out_is_known_no_more_and_the_rest_as_before() -> None:
    along = 1.1
    H = informed((along + math.pi / 2, 400.0), (along, 0.5))
    left = project_out_weak(H)
    least = observe(H).least_known
    assert abs(math.remainder(least - along, math.pi)) < 1e-3
    np.testing.assert_allclose(left @ [math.cos(least), math.sin(least), 0.0], 0.0, atol=1e-9)
    np.testing.assert_allclose(left, without_direction(H, least), atol=1e-9)


def test_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match="3x3"):
        observe(np.eye(2))
