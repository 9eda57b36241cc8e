"""Sparse elimination against dense algebra; derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.graph import Edge, Piece
from lineloom_core.graph import _elimination_kernels as kernels
from lineloom_core.graph.normal_equations import NormalEquations

from tests.core.graph import dense_twins
from tests.core.graph.graphs import random_piece


def filled(count: int, ends: np.ndarray, order: np.ndarray) -> set[tuple[int, int]]:
    """Pairs of places in the order that elimination links, the obvious way."""
    place = {int(v): i for i, v in enumerate(order)}
    links = {frozenset((place[int(a)], place[int(b)])) for a, b in ends}
    for j in range(count):
        later = [k for k in range(j + 1, count) if frozenset((j, k)) in links]
        links |= {frozenset((p, q)) for p in later for q in later if p != q}
    return {(min(pair), max(pair)) for pair in links}


@pytest.mark.parametrize("seed", range(6))
def test_order_and_fill_are_those_of_elimination(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 40))
    piece, _ = random_piece(rng, count, int(rng.integers(0, 2 * count)))
    order, starts, rows = kernels.minimum_degree(count, piece.ends)
    assert sorted(order.tolist()) == list(range(count))
    found = {(j, int(r)) for j in range(count) for r in rows[starts[j] : starts[j + 1]]}
    assert found == filled(count, piece.ends, order)
    assert all(np.all(np.diff(rows[starts[j] : starts[j + 1]]) > 0) for j in range(count))


def test_a_chain_is_folded_up_without_fill() -> None:
    count = 1000
    ends = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    _, starts, rows = kernels.minimum_degree(count, ends)
    assert len(rows) == count - 1
    assert starts[-1] == count - 1


@pytest.mark.parametrize("seed", range(8))
def test_cost_and_gradient_are_those_of_the_errors(seed: int) -> None:
    """Also where edges are far from fitting: the derivatives are exact."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 12))
    piece, _ = random_piece(rng, count, count, noise=float(rng.uniform(0.0, 40.0)))
    held = int(rng.integers(count))
    equations = NormalEquations(piece, held)
    assert equations.cost_at(piece.poses, renew=False) == pytest.approx(
        dense_twins.cost(piece, piece.poses)
    )
    expected = dense_twins.gradient(piece, piece.poses)
    columns = equations.column_of
    assert columns[held] == -1
    free = np.flatnonzero(columns >= 0)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(
        equations.gradient[columns[free]], expected[free], atol=1e-5 * max(scale, 1.0)
    )


@pytest.mark.parametrize("seed", range(8))
def test_the_factor_inverts_the_dense_matrix(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    count = int(rng.integers(2, 14))
    piece, _ = random_piece(rng, count, int(rng.integers(0, count)), noise=8.0)
    weights = rng.uniform(0.2, 2.0, len(piece.ends))
    held = int(rng.integers(count))
    equations = NormalEquations(piece, held, weights)
    equations.cost_at(piece.poses, renew=True)
    assert equations.factorise()
    free = np.delete(np.arange(count), held)
    index = (3 * free[:, None] + np.arange(3)).ravel()
    H = dense_twins.matrix(piece, piece.poses, weights)[np.ix_(index, index)]
    inverse = np.linalg.inv(H).reshape(len(free), 3, len(free), 3).swapaxes(1, 2)
    scale = np.abs(inverse).max()
    columns = equations.column_of[free]
    found, places = equations.inverse_diagonal()[columns], range(len(free))
    np.testing.assert_allclose(found, inverse[places, places], atol=1e-6 * scale)
    for place, row in enumerate(free.tolist()):
        found = equations.inverse_columns(row)[columns]
        np.testing.assert_allclose(found, inverse[:, place], atol=1e-6 * scale)


def test_a_node_that_hangs_loose_has_no_factor() -> None:
    """Even behind a node that is well tied to it: what is left of its pivot is rounding."""
    turn = Pose(0.3, 0.2, 0.7)
    slack = np.diag([0.0, 900.0, 700.0])
    firm = np.diag([2500.0, 1700.0, 40000.0])
    nodes = {0: Pose.identity(), 1: turn, 2: turn @ turn}
    edges = [
        Edge("slack", "loop", 0, 1, turn, slack, True),
        Edge("firm", "sequential", 1, 2, turn, firm, False),
    ]
    equations = NormalEquations(Piece.of(nodes, edges), 0)
    equations.cost_at(Piece.of(nodes, edges).poses, renew=True)
    assert not equations.factorise()
