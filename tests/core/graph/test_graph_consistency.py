"""Pairwise-consistent sets against brute force, and observability on hand-made rooms."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.graph import (
    consistent_sets,
    cycle_errors,
    largest_consistent_set,
    observe,
    pairwise_consistent,
    project_out_weak,
)
from numpy.typing import NDArray

SIGMAS = np.array([0.03, 0.03, 0.01])


def candidates(
    right: int, wrong: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    T_A_B = Pose(3.0, 8.0, -1.4)
    rows_a, rows_b, rows_z = [], [], []
    for k in range(right + wrong):
        T_A_a = Pose.from_array(rng.uniform([-9.0, -9.0, -3.0], [9.0, 9.0, 3.0]))
        z = Pose(*rng.uniform(-1.0, 1.0, 3).tolist())
        T_B_b = T_A_B.inverse() @ T_A_a @ z
        z = z @ Pose.from_array(rng.normal(0.0, SIGMAS))
        if k >= right:
            z = z @ Pose(*rng.uniform(-5.0, 5.0, 3).tolist())
        rows_a.append(T_A_a.to_array())
        rows_b.append(T_B_b.to_array())
        rows_z.append(z.to_array())
    covariance = np.broadcast_to(np.diag(SIGMAS**2), (right + wrong, 3, 3))
    return np.array(rows_a), np.array(rows_b), np.array(rows_z), covariance


def brute_force(consistent: NDArray[np.bool_]) -> tuple[int, ...]:
    n = consistent.shape[0]
    for size in range(n, 0, -1):
        for chosen in itertools.combinations(range(n), size):
            if all(consistent[i, j] for i, j in itertools.combinations(chosen, 2)):
                return chosen
    return ()


def random_matrix(n: int, density: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    upper = np.triu(rng.random((n, n)) < density, 1)
    return np.asarray(upper | upper.T | np.eye(n, dtype=bool))


def test_right_constraints_agree_and_wrong_ones_do_not() -> None:
    arrays = candidates(12, 8, seed=0)
    consistent = pairwise_consistent(*arrays)
    assert (consistent == consistent.T).all()
    assert consistent.diagonal().all()
    assert consistent[:12, :12].mean() > 0.95
    assert consistent[12:, :12].mean() < 0.05
    assert set(largest_consistent_set(consistent)) <= set(range(12))


def test_cycle_error_is_chi_squared_for_right_pairs() -> None:
    """3 degrees of freedom: mean 3, 1 % beyond the 99 % quantile."""
    upper = np.triu_indices(4, 1)
    figures = np.concatenate([cycle_errors(*candidates(4, 0, s))[upper] for s in range(150)])
    assert figures.mean() == pytest.approx(3.0, abs=0.4)
    assert 0.002 < (figures > 11.345).mean() < 0.03


def test_cycle_error_against_a_slow_twin() -> None:
    a, b, z, C = candidates(3, 3, seed=5)
    d2 = cycle_errors(a, b, z, C, drift_a=lambda i, j: 0.001 * np.eye(3))
    for i, j in itertools.combinations(range(6), 2):
        Ai, Aj, Bi, Bj = (Pose.from_array(p) for p in (a[i], a[j], b[i], b[j]))
        zi, zj = Pose.from_array(z[i]), Pose.from_array(z[j])
        after_i = Bi.between(Bj) @ zj.inverse() @ Aj.between(Ai)
        after_b = zj.inverse() @ Aj.between(Ai)
        total = 0.001 * np.eye(3)
        for cov, T in ((C[i], after_i), (C[j], after_b)):
            A = T.inverse().adjoint()
            total = total + A @ cov @ A.T
        E = zi @ after_i
        half = E.theta / 2.0
        V_inv = np.array([[half / math.tan(half), half], [-half, half / math.tan(half)]])
        error = np.array([*(V_inv @ [E.x, E.y]), E.theta])
        assert d2[i, j] == pytest.approx(error @ np.linalg.inv(total) @ error, rel=1e-6)


def test_drift_makes_far_pairs_tolerant() -> None:
    a, b, z, C = candidates(2, 0, seed=1)
    z = z.copy()
    z[1, 0] += 0.5
    assert not pairwise_consistent(a, b, z, C)[0, 1]
    wide = np.tile(np.diag([0.3, 0.3, 0.05]), (2, 2, 1, 1))
    assert pairwise_consistent(a, b, z, C, drift_a=wide, drift_b=wide)[0, 1]


def test_exact_inputs_agree_with_zero_error() -> None:
    a, b, z, _ = candidates(5, 0, seed=2)
    T = Pose(3.0, 8.0, -1.4)
    z = np.array(
        [
            Pose.from_array(p).between(T @ Pose.from_array(q)).to_array()
            for p, q in zip(a, b, strict=True)
        ]
    )
    assert cycle_errors(a, b, z, np.zeros((5, 3, 3))).max() < 1e-6
    assert cycle_errors(a[:1], b[:1], z[:1], np.zeros((1, 3, 3))).tolist() == [[0.0]]
    assert largest_consistent_set(np.zeros((0, 0), dtype=bool)) == ()


def test_largest_set_against_brute_force() -> None:
    rng = np.random.default_rng(3)
    for _ in range(120):
        n = int(rng.integers(1, 12))
        consistent = random_matrix(n, float(rng.uniform(0.2, 0.9)), rng)
        assert largest_consistent_set(consistent) == brute_force(consistent)


def test_greedy_is_a_set_and_mostly_the_largest() -> None:
    rng = np.random.default_rng(4)
    largest = 0
    for _ in range(60):
        consistent = random_matrix(12, 0.5, rng)
        found = largest_consistent_set(consistent, exact_up_to=0)
        assert consistent[np.ix_(found, found)].all()
        largest += len(found) == len(brute_force(consistent))
    assert largest > 54


def test_hundreds_of_constraints_take_no_time_and_a_planted_set_is_found() -> None:
    rng = np.random.default_rng(5)
    consistent = random_matrix(400, 0.3, rng)
    planted = np.sort(rng.choice(400, 40, replace=False))
    consistent[np.ix_(planted, planted)] = True
    assert set(largest_consistent_set(consistent)) >= set(planted.tolist())


def test_hard_small_case_falls_back_on_greedy_within_its_budget() -> None:
    consistent = random_matrix(64, 0.9, np.random.default_rng(6))
    found = largest_consistent_set(consistent)
    assert consistent[np.ix_(found, found)].all()
    assert found == largest_consistent_set(consistent)


def test_rival_sets_come_second() -> None:
    consistent = np.eye(7, dtype=bool)
    for group in ([1, 3, 5], [0, 2]):
        consistent[np.ix_(group, group)] = True
    assert consistent_sets(consistent) == ((1, 3, 5), (0, 2))
    assert consistent_sets(consistent, least=3) == ((1, 3, 5),)


def wall_information(
    walls: list[tuple[float, float, float]], sigma: float = 0.02
) -> NDArray[np.float64]:
    """Information of points seen on walls: each (x, y, angle of the normal)."""
    rows = [[math.cos(n), math.sin(n), x * math.sin(n) - y * math.cos(n)] for x, y, n in walls]
    J = np.array(rows)
    return np.asarray(J.T @ J / sigma**2)


def corridor(angle: float) -> NDArray[np.float64]:
    walls = []
    for s in np.linspace(-4.0, 4.0, 30):
        for side in (-1.0, 1.0):
            x, y = (
                s * math.cos(angle) - side * math.sin(angle),
                s * math.sin(angle) + side * math.cos(angle),
            )
            walls.append((x, y, angle + math.pi / 2))
    return wall_information(walls)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.5, 2.9])
def test_a_corridor_is_weak_along_itself(angle: float) -> None:
    judged = observe(corridor(angle))
    assert judged.weak_translation == 1
    assert not judged.weak_rotation
    assert not judged.full
    assert judged.weak_direction is not None
    assert math.remainder(judged.weak_direction - angle, math.pi) == pytest.approx(0.0, abs=1e-6)
    assert judged.lambda_min < 1e-3 < judged.lambda_max


def test_a_corner_is_full() -> None:
    walls = [(x, 2.0, math.pi / 2) for x in np.linspace(-2, 2, 20)]
    walls += [(2.0, y, 0.0) for y in np.linspace(-2, 2, 20)]
    judged = observe(wall_information(walls))
    assert judged.full
    assert judged.weak_direction is None
    np.testing.assert_allclose(
        project_out_weak(wall_information(walls)), wall_information(walls), rtol=1e-12
    )


def test_a_round_room_has_no_rotation() -> None:
    centred = [(2 * math.cos(t), 2 * math.sin(t), t) for t in np.linspace(0, 2 * math.pi, 50)]
    judged = observe(wall_information(centred))
    assert judged.weak_rotation
    assert judged.weak_translation == 0
    projected = project_out_weak(wall_information(centred))
    np.testing.assert_allclose(projected[2], 0.0, atol=1e-6)
    assert projected[0, 0] > 1e4


def test_a_round_room_seen_from_its_edge_has_no_free_turn_either() -> None:
    """Turning about the centre moves the lidar too: nothing but the distance to it is known."""
    away = [
        (1 + 2 * math.cos(t), 2 * math.sin(t), t)
        for t in np.linspace(0, 2 * math.pi, 50, endpoint=False)
    ]
    projected = project_out_weak(wall_information(away))
    np.testing.assert_allclose(projected @ [0.0, 1.0, 0.0], 0.0, atol=1e-6)
    np.testing.assert_allclose(projected @ [0.0, 0.0, 1.0], 0.0, atol=1e-6)
    assert projected[0, 0] > 1e4


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0])
def test_projection_keeps_what_holds_whatever_the_slide(angle: float) -> None:
    information = corridor(angle) + 0.5 * np.eye(3)
    projected = project_out_weak(information)
    along = np.array([math.cos(angle), math.sin(angle), 0.0])
    across = np.array([-math.sin(angle), math.cos(angle), 0.0])
    np.testing.assert_allclose(projected @ along, 0.0, atol=1e-6)
    assert across @ projected @ across > 1e4
    assert projected[2, 2] > 1e4
    assert np.linalg.eigvalsh(projected)[0] > -1e-6
    np.testing.assert_allclose(project_out_weak(projected), projected, atol=1e-6)


def test_nothing_seen_constrains_nothing() -> None:
    judged = observe(np.zeros((3, 3)))
    assert judged.weak_translation == 2
    assert judged.weak_rotation
    np.testing.assert_array_equal(project_out_weak(np.zeros((3, 3))), np.zeros((3, 3)))
    with pytest.raises(ValueError, match="3x3"):
        observe(np.eye(2))
