"""Covariances, first poses, and the inlier test."""

from __future__ import annotations

import gtsam
import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.graph import (
    Covariances,
    Edge,
    Piece,
    UndeterminedError,
    in_map_axes,
    marginal_covariance,
    optimize,
    rigid_join,
)
from lineloom_core.graph.edge import chi_squared
from numpy.typing import NDArray


def random_information(rng: np.random.Generator) -> NDArray[np.float64]:
    L = rng.normal(size=(3, 3))
    return np.asarray(L @ L.T * 300.0 + np.diag([200.0, 200.0, 1000.0]))


def small_graph(n: int = 25, seed: int = 0) -> tuple[dict[int, Pose], list[Edge]]:
    rng = np.random.default_rng(seed)
    truth = {i: Pose.from_array(rng.uniform([-5.0, -5.0, -3.0], [5.0, 5.0, 3.0])) for i in range(n)}
    pairs = [(i, i + 1) for i in range(n - 1)] + [(i, i + 6) for i in range(0, n - 6, 3)]
    edges = [
        Edge(f"e{a}-{b}", "loop", a, b, truth[a].between(truth[b]), random_information(rng), False)
        for a, b in pairs
    ]
    return truth, edges


def test_marginals_agree_with_gtsam() -> None:
    poses, edges = small_graph()
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for i, p in poses.items():
        values.insert(i, gtsam.Pose2(p.x, p.y, p.theta))
    for e in edges:
        noise = gtsam.noiseModel.Gaussian.Information(e.information)
        z = gtsam.Pose2(e.T_a_b.x, e.T_a_b.y, e.T_a_b.theta)
        graph.add(gtsam.BetweenFactorPose2(e.node_a, e.node_b, z, noise))
    at = poses[4]
    prior = gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)
    graph.add(gtsam.PriorFactorPose2(4, gtsam.Pose2(at.x, at.y, at.theta), prior))
    marginals = gtsam.Marginals(graph, values)
    covariances = Covariances(Piece.of(poses, edges), anchor=4)
    for node in (0, 5, 24):
        np.testing.assert_allclose(
            covariances.of(node), marginals.marginalCovariance(node), rtol=1e-4, atol=1e-9
        )
    np.testing.assert_array_equal(covariances.of(4), np.zeros((3, 3)))


def test_relative_covariance_does_not_depend_on_the_anchor() -> None:
    poses, edges = small_graph()
    piece = Piece.of(poses, edges)
    first = Covariances(piece, anchor=0).relative(7, 19)
    other = Covariances(piece, anchor=7)
    np.testing.assert_allclose(first, other.relative(7, 19), rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(first, other.of(19), rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(
        first, marginal_covariance(poses, edges, 3, 7, 19), rtol=1e-9, atol=1e-14
    )


def test_one_edge_gives_back_its_own_covariance() -> None:
    rng = np.random.default_rng(1)
    information = random_information(rng)
    T = Pose(1.0, 2.0, 0.7)
    edge = Edge("e", "loop", 0, 1, T, information, True)
    C = marginal_covariance({0: Pose(3.0, 1.0, 2.0), 1: Pose(3.0, 1.0, 2.0) @ T}, [edge], 0, 1)
    np.testing.assert_allclose(C, np.linalg.inv(information), rtol=1e-9)
    piece = Piece.of({0: Pose.identity(), 1: T}, [edge])
    halved = Covariances(piece, 0, weights=np.array([0.5])).of(1)
    np.testing.assert_allclose(halved, 2.0 * np.linalg.inv(information), rtol=1e-9)


def test_covariance_in_map_axes_follows_the_samples() -> None:
    rng = np.random.default_rng(2)
    pose, C = Pose(4.0, -2.0, 1.1), np.diag([0.04, 0.0004, 0.0001])
    samples = np.array(
        [
            (pose @ Pose.from_array(rng.multivariate_normal(np.zeros(3), C))).to_array()
            for _ in range(4000)
        ]
    )
    np.testing.assert_allclose(np.cov(samples.T), in_map_axes(C, pose), atol=0.003)


def test_what_hangs_loose_is_said_so() -> None:
    free = Edge("e", "loop", 0, 1, Pose.identity(), np.diag([0.0, 10.0, 10.0]), True)
    with pytest.raises(UndeterminedError):
        Covariances(Piece.of({0: Pose.identity(), 1: Pose.identity()}, [free]), 0)
    with pytest.raises(KeyError, match="5"):
        Covariances(Piece.of({0: Pose.identity()}, []), 0).of(5)


def two_pieces(
    wrong: int, seed: int = 3
) -> tuple[dict[int, Pose], dict[int, Pose], list[Edge], Pose]:
    rng = np.random.default_rng(seed)
    a = {i: Pose(i * 1.0, 0.2 * i, 0.1 * i) for i in range(12)}
    T_A_B = Pose(4.0, -7.0, 2.2)
    b = {100 + i: T_A_B.inverse() @ Pose(i * 0.9, 1.0, -0.1 * i) for i in range(12)}
    edges = []
    for k in range(8):
        i, j = k, 100 + (k * 5) % 12
        T = a[i].between(T_A_B @ b[j]) @ Pose.from_array(rng.normal(0, [0.02, 0.02, 0.01]))
        if k < wrong:
            T = T @ Pose(*rng.uniform(-4.0, 4.0, 3).tolist())
        information = np.diag([2500.0, 2500.0, 10000.0])
        if k % 2:  # the other way round: a rendezvous may be found from either side
            edges.append(Edge(f"r{k}", "rendezvous", j, i, T.inverse(), information, True))
        else:
            edges.append(Edge(f"r{k}", "rendezvous", i, j, T, information, True))
    return a, b, edges, T_A_B


@pytest.mark.parametrize("wrong", [0, 3])
def test_rigid_join_finds_the_frame_in_spite_of_wrong_edges(wrong: int) -> None:
    a, b, edges, T_A_B = two_pieces(wrong)
    found = rigid_join(a, b, edges)
    assert found.distance(T_A_B) < 0.08
    assert abs(found.theta - T_A_B.theta) < 0.01
    assert rigid_join(a, b, edges[::-1]) == found


def test_rigid_join_needs_edges_across() -> None:
    a, b, edges, _ = two_pieces(0)
    with pytest.raises(ValueError, match="no edge"):
        rigid_join(a, b, [])
    with pytest.raises(ValueError, match="r0"):
        rigid_join(a, a, edges)


def test_turning_an_edge_round_changes_nothing() -> None:
    """The information must be carried to the other end, adjoint and all."""
    rng = np.random.default_rng(4)
    information = random_information(rng)
    T = Pose(2.0, -1.0, 0.6)
    poses = {0: Pose(1.0, 1.0, 0.3), 1: Pose(1.0, 1.0, 0.3) @ T @ Pose(0.001, -0.002, 0.001)}
    A = T.inverse().adjoint()
    turned = Edge("t", "loop", 1, 0, T.inverse(), A.T @ information @ A, True)
    straight = Edge("s", "loop", 0, 1, T, information, True)
    chi2 = chi_squared([straight, turned], poses)
    assert chi2[0] == pytest.approx(chi2[1], rel=5e-3)


def test_covariance_shrinks_when_a_loop_closes() -> None:
    step = np.diag([2500.0, 2500.0, 10000.0])
    poses = {i: Pose(0.5 * i, 0.0, 0.0) for i in range(100)}
    edges = [
        Edge(f"s{i}", "sequential", i, i + 1, Pose(0.5, 0.0, 0.0), step, False) for i in range(99)
    ]
    open_chain = np.trace(marginal_covariance(poses, edges, 0, 99))
    closed = [*edges, Edge("loop", "loop", 0, 99, poses[99], step, True)]
    assert (
        np.trace(marginal_covariance(optimize(poses, closed).poses, closed, 0, 99))
        < 0.1 * open_chain
    )
