"""ISAM2 as the pose graph has it: near the optimum, the same bits, covariances of a dense twin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph import Edge, UnsettledError, bayes_tree
from lineloom_core.graph.bayes_tree import BayesTree
from lineloom_core.graph.epoch import Epoch
from lineloom_core.graph.growth import Growth
from numpy.typing import NDArray

from tests.core.graph import dense_twins
from tests.core.graph.graphs import edges_of, laps, random_component, random_information


def grown(component: Growth, parts: int) -> list[Growth]:
    """The same in parts: nodes in their order, each edge with the later one of its nodes."""
    edges, taken = edges_of(component), 0
    growths = []
    for ids in np.array_split(component.ids, parts):
        last = int(ids[-1])
        new = [e for e in edges if taken <= max(e.node_a, e.node_b) <= last]
        growths.append(Growth.of(ids, component.poses[ids], new))
        taken = last + 1
    return growths


def walk(seed: int, count: int = 24) -> Growth:
    """A random component whose start is near its optimum, as that of a graph that grows is."""
    component, _ = random_component(np.random.default_rng(seed), count, count // 2, noise=0.3)
    return component


@pytest.mark.parametrize("seed", range(6))
def test_growing_ends_near_the_dense_optimum(seed: int) -> None:
    component = walk(seed)
    tree = BayesTree("poses", 0, component)
    assert np.abs(se2.between(dense_twins.optimum(component, 0), tree.poses)).max() < 5e-3
    first, *later = grown(component, 6)
    grows = BayesTree("poses", 0, first)
    for growth in later:
        grows.grow(growth)
    assert np.abs(se2.between(tree.poses, grows.poses)).max() < 1e-2


def test_what_is_removed_is_as_if_it_had_never_been_there() -> None:
    component = walk(3)
    edges = edges_of(component)
    loops = [k for k, e in enumerate(edges) if e.robust]
    tree = BayesTree("poses", 0, component)
    tree.grow(Growth.of(np.zeros(0, np.int64), np.zeros((0, 3)), [], removed=loops[:6]))
    left = [e for k, e in enumerate(edges) if k not in loops[:6]]
    rest = Growth.of(component.ids, component.poses, left)
    assert np.abs(se2.between(dense_twins.optimum(rest, 0), tree.poses)).max() < 5e-3


def test_a_node_leaves_with_its_last_edge() -> None:
    """As when keyframes are let go: one step over the run takes the place of several."""
    _, edges = laps(40, 0, seed=2)
    poses = np.zeros((40, 3))
    for k, e in enumerate(edges):
        poses[k + 1] = se2.compose(poses[k], e.T_a_b.to_array())
    epoch = Epoch(0, Growth.of(np.arange(40), poses, edges))
    over = edges[9].T_a_b @ edges[10].T_a_b @ edges[11].T_a_b
    step = replace(edges[11], node_a=9, T_a_b=over)
    none = np.zeros(0, np.int64), np.zeros((0, 3))
    epoch.grow(Growth.of(*none, [step], removed=[9, 10, 11], gone=[10, 11]))
    ids, found = epoch.estimates()
    assert ids.tolist() == [k for k in range(40) if k not in (10, 11)]
    np.testing.assert_allclose(found, poses[ids], atol=1e-6)
    assert set(epoch.numbers) == {e.id for e in edges} - {edges[9].id, edges[10].id}
    with pytest.raises(KeyError, match="10"):
        epoch.drift([3, 10])


@pytest.mark.parametrize("seed", range(4))
def test_relative_covariances_are_those_of_the_dense_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    component = walk(seed, 25)
    spread = np.array([random_information(rng) for _ in component.ends])
    component = replace(component, drift_information=spread)
    nodes = rng.permutation(25)[:7].tolist()
    found = BayesTree("drift", 0, component).relative_covariances(nodes)
    for i, a in enumerate(nodes):
        for j, b in enumerate(nodes):
            expected = (
                np.zeros((3, 3))
                if a == b
                else dense_twins.relative_covariance(component, component.poses, a, b)
            )
            np.testing.assert_allclose(found[i, j], expected, atol=2e-3 * np.abs(expected).max())


def test_one_edge_gives_back_its_own_covariance() -> None:
    information = random_information(np.random.default_rng(1))
    T = Pose(1.0, 2.0, 0.7)
    edge = Edge("e", "sequential", 0, 1, T, 9.0 * information, False, information)
    poses = np.array([(3.0, 1.0, 2.0), (Pose(3.0, 1.0, 2.0) @ T).to_array()])
    found = BayesTree("drift", 0, Growth.of(np.arange(2), poses, [edge])).relative_covariances(
        [0, 1]
    )
    np.testing.assert_allclose(found[0, 1], np.linalg.inv(information), rtol=1e-6)


def bits(epoch: Epoch) -> tuple[bytes, bytes]:
    return epoch.estimates()[1].tobytes(), epoch.drift([1, 4, 9]).tobytes()


def test_an_epoch_that_was_stored_goes_on_with_the_same_bits() -> None:
    """Stored anywhere in between, and asked in between or not."""
    first, *later = grown(walk(9), 10)
    steady = Epoch(0, first)
    for stored_at in (0, 3, 8):
        kept = Epoch(0, first)
        for k, growth in enumerate(later):
            if k == stored_at:
                kept = decode(encode(kept), Epoch)
            kept.grow(growth)
        if stored_at == 0:
            for growth in later:
                steady.grow(growth)
                steady.estimates()
        assert bits(kept) == bits(steady)
        assert kept.numbers == steady.numbers
        assert kept.nodes == steady.nodes


def test_what_does_not_come_to_rest_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Poses that are metres off take more than one round."""
    monkeypatch.setattr(bayes_tree, "_MOST_ROUNDS", 1)
    component = walk(1)
    off = np.random.default_rng(2).normal(0.0, (4.0, 4.0, 1.0), component.poses.shape)
    with pytest.raises(UnsettledError, match="rest"):
        BayesTree("poses", 0, replace(component, poses=se2.compose(component.poses, off)))


def test_an_unknown_node_is_named() -> None:
    tree = BayesTree("drift", 0, walk(0, 5))
    with pytest.raises(KeyError, match="77"):
        tree.relative_covariances([1, 77])


@pytest.mark.long
def test_the_chain_of_a_hundred_thousand() -> None:
    """Without a loop gtsam's tree is as deep as the chain is long."""
    n = 100_000
    poses: NDArray[np.float64] = np.zeros((n, 3))
    poses[:, 0] = 0.5 * np.arange(n)
    information = np.tile(np.diag([2500.0, 2500.0, 40000.0]), (n - 1, 1, 1))
    start = Growth(
        ids=np.arange(n),
        poses=poses,
        names=tuple(map(str, range(n - 1))),
        ends=np.column_stack([np.arange(n - 1), np.arange(1, n)]),
        measured=np.tile([0.5, 0.0, 0.0], (n - 1, 1)),
        information=information,
        drift_information=information,
        robust=np.zeros(n - 1, np.bool_),
    )
    epoch = Epoch(0, start)
    np.testing.assert_allclose(epoch.estimates()[1], poses, atol=1e-6)
    drift = epoch.drift([n - 2, n - 1])
    np.testing.assert_allclose(drift[0, 1], np.linalg.inv(information[0]), rtol=1e-2)
