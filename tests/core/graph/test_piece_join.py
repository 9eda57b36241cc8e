"""The frame in which a piece of graph joins another, and edges written from their other end."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph import Edge, rigid_join
from lineloom_core.graph.growth import Growth

from tests.core.graph import dense_twins
from tests.core.graph.graphs import random_information


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
    pair = Growth.of(np.arange(2), se2.stack(poses.values()), [straight, turned])
    chi2 = dense_twins.chi2(pair, pair.poses)
    assert chi2[0] == pytest.approx(chi2[1], rel=5e-3)
