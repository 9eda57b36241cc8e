"""Gauss-Newton with sparse elimination: the same answer as gtsam's, and better settled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph import Edge, Piece, settle
from lineloom_core.graph.relax import relax
from lineloom_core.graph.solver import levenberg_marquardt

from tests.core.graph import dense_twins
from tests.core.graph.graphs import INFORMATION, dead_reckoning, laps, random_piece


@pytest.mark.parametrize("seed", range(12))
def test_random_graphs_settle_where_the_batch_solver_ends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 80))
    piece, _ = random_piece(rng, count, int(rng.integers(0, count)), wrong=seed % 3)
    held = int(rng.integers(count))
    found = relax(piece, held)
    assert found is not None
    batch = levenberg_marquardt(piece, held, tolerance=1e-13)
    assert np.abs(se2.between(batch, found)).max() < 2e-4
    assert dense_twins.cost(piece, found) <= dense_twins.cost(piece, batch) * (1.0 + 1e-9) + 1e-9
    np.testing.assert_array_equal(found[held], piece.poses[held])


@pytest.mark.parametrize("seed", range(4))
def test_where_it_settles_the_cost_is_flat(seed: int) -> None:
    piece, _ = random_piece(np.random.default_rng(seed), 12, 8, wrong=1)
    found = relax(piece, 3)
    assert found is not None
    before = np.abs(np.delete(dense_twins.gradient(piece, piece.poses), 3, axis=0)).max()
    after = np.abs(np.delete(dense_twins.gradient(piece, found), 3, axis=0)).max()
    assert after < 1e-4 * before


def test_laps_with_wrong_loops_end_as_the_batch_solver_says() -> None:
    _, edges = laps(600, 120, seed=11, wrong=25)
    piece = Piece.of(dead_reckoning(600, edges), edges)
    warm = replace(piece, poses=levenberg_marquardt(piece, 0, tolerance=1e-13))
    found = relax(warm, 0)
    assert found is not None
    assert np.abs(se2.between(warm.poses, found)).max() < 1e-4


def test_consistent_graphs_are_met_exactly() -> None:
    rng = np.random.default_rng(5)
    piece, truth = random_piece(rng, 40, 30, noise=0.0)
    off = se2.compose(truth, rng.normal(0.0, (0.1, 0.1, 0.03), truth.shape))
    off[7] = truth[7]
    found = relax(replace(piece, poses=off), 7)
    assert found is not None
    np.testing.assert_allclose(se2.between(truth, found), 0.0, atol=1e-7)


def test_moving_the_whole_graph_moves_the_answer_along() -> None:
    piece, _ = random_piece(np.random.default_rng(6), 60, 40, wrong=2)
    T = Pose(30.0, -20.0, 2.5)
    first, second = relax(piece, 0), relax(piece.moved(T), 0)
    assert first is not None
    assert second is not None
    expected = se2.compose(T.to_array(), first)
    np.testing.assert_allclose(se2.between(expected, second), 0.0, atol=1e-6)


def test_a_tail_follows_its_end_rigidly() -> None:
    """What hangs on one edge only has nothing to weigh: it is just composed."""
    piece, _ = random_piece(np.random.default_rng(8), 20, 20)
    steps = [Pose(0.5, 0.1 * k, 0.2) for k in range(6)]
    nodes = dict(piece.table(piece.poses))
    for k in range(6):
        nodes[20 + k] = nodes[19 + k] @ Pose(0.1, 0.0, 0.0)
    tail = [
        Edge(f"t{k}", "sequential", 19 + k, 20 + k, step, INFORMATION, False)
        for k, step in enumerate(steps)
    ]
    bare = relax(piece, 0)
    whole = Piece.of(nodes, []).with_edges(tail)
    whole = replace(
        whole,
        ends=np.concatenate([piece.ends, whole.ends]),
        measured=np.concatenate([piece.measured, whole.measured]),
        information=np.concatenate([piece.information, whole.information]),
        robust=np.concatenate([piece.robust, whole.robust]),
    )
    found = relax(whole, 0)
    assert bare is not None
    assert found is not None
    np.testing.assert_allclose(found[:20], bare, atol=1e-6)
    for k, step in enumerate(steps):
        expected = se2.compose(found[19 + k], step.to_array())
        np.testing.assert_allclose(found[20 + k], expected, atol=1e-6)


def test_the_same_values_give_the_same_bits() -> None:
    piece, _ = random_piece(np.random.default_rng(9), 200, 100)
    first, second = relax(piece, 0), relax(replace(piece, poses=piece.poses.copy()), 0)
    assert first is not None
    assert second is not None
    assert first.tobytes() == second.tobytes()


def test_a_poor_start_is_left_to_damping() -> None:
    """Loops that start metres off: Gauss-Newton may overshoot, the answer must not suffer."""
    gave_up = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        piece, _ = random_piece(rng, 40, 12)
        off = replace(
            piece, poses=se2.compose(piece.poses, rng.normal(0.0, (4.0, 4.0, 1.5), (40, 3)))
        )
        gave_up += relax(off, 0) is None
        settled = settle(off, 0)
        assert dense_twins.cost(off, settled) <= dense_twins.cost(off, off.poses)
        assert np.isfinite(settled).all()
    assert gave_up > 0


def test_one_node_and_one_edge() -> None:
    alone = Piece.of({4: Pose(1.0, 2.0, 0.5)}, [])
    np.testing.assert_array_equal(settle(alone, 0), [[1.0, 2.0, 0.5]])
    T = Pose(1.0, 0.2, 0.3)
    edge = Edge("e", "loop", 0, 1, T, INFORMATION, True)
    pair = Piece.of({0: Pose(5.0, 1.0, 3.0), 1: Pose(4.0, 1.0, -3.0)}, [edge])
    found = settle(pair, 0)
    np.testing.assert_allclose(found[1], (Pose(5.0, 1.0, 3.0) @ T).to_array(), atol=1e-7)
