"""A pose graph whose components are Bayes trees, while keyframes and edges come and go."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph import Edge, PoseGraph

from tests.core.graph import dense_twins
from tests.core.graph.graphs import INFORMATION, components_of, laps, perturbed

LAP = 160
"""Keyframes between two passes of one spot (`laps`)."""


def driven(
    count: int, loops: int, *, first: int = 0, seed: int = 0
) -> tuple[PoseGraph, list[Edge]]:
    """A graph that has only been tracked, and the loops that may enter."""
    _, edges = laps(count, loops, seed)
    graph = PoseGraph()
    graph.add_node(first, Pose.identity())
    for e in edges[: count - 1]:
        graph.add_node(first + e.node_b, graph.pose(first + e.node_a) @ e.T_a_b)
        graph.add_edge(shifted(e, first))
    return graph, [shifted(e, first) for e in edges[count - 1 :]]


def shifted(e: Edge, by: int) -> Edge:
    return Edge(
        f"{e.id}+{by}", e.kind, e.node_a + by, e.node_b + by, e.T_a_b, e.information, e.robust
    )


def poses_of(graph: PoseGraph) -> np.ndarray:
    return se2.stack(graph.nodes.values())


def off(first: PoseGraph, second: PoseGraph) -> float:
    """Greatest difference of any pose, m or rad."""
    assert list(first.nodes) == list(second.nodes)
    return float(np.abs(se2.between(poses_of(first), poses_of(second))).max())


def ways(graph: PoseGraph) -> list[PoseGraph]:
    """The graph, and what comes back when it is stored."""
    return [graph, decode(encode(graph), PoseGraph)]


def bits(graph: PoseGraph) -> tuple[bytes, bytes]:
    nodes = components_of(graph)[0][::7]
    return poses_of(graph).tobytes(), graph.drift(nodes).tobytes()


def test_a_keyframe_that_waits_lies_where_its_step_leads_and_enters_with_the_next_loop() -> None:
    graph, loops = driven(200, 4)
    assert graph.factors() == frozenset()
    assert not graph.is_solved(3)
    for loop in loops:
        graph.add_edge(loop)
    graph.optimise(7)
    assert graph.factors() == set(graph.edges)
    graph.add_node(200, graph.pose(199) @ Pose(0.5, 0.0, 0.0))
    graph.add_edge(Edge("on", "sequential", 199, 200, Pose(0.5, 0.0, 0.0), INFORMATION, False))
    assert graph.is_solved(199)
    assert not graph.is_solved(200)
    assert graph.factors() == set(graph.edges) - {"on"}
    graph.optimise(7)
    assert graph.factors() == set(graph.edges)
    assert graph.pose(0) == Pose.identity()


def test_it_stays_near_the_optimum_and_settles_there() -> None:
    graph, loops = driven(360, 40, seed=3)
    for loop in loops:
        graph.add_edge(loop)
        graph.optimise(0)
    before = poses_of(graph)
    settled = graph.settled()
    assert off(graph, settled) < 0.03
    np.testing.assert_array_equal(poses_of(graph), before)  # which is not fed back
    component = settled._component(0)
    twin_cost = dense_twins.cost(component, poses_of(settled))
    rng = np.random.default_rng(0)
    for row in rng.integers(1, 360, 20).tolist():
        for axis, by in itertools.product(range(3), (-1e-4, 1e-4)):
            aside = dense_twins.moved(poses_of(settled), row, axis, by)
            assert dense_twins.cost(component, aside) > twin_cost


def test_a_stored_graph_goes_on_with_the_same_bits_anywhere_in_an_epoch() -> None:
    """Loops enter and leave, keyframes are let go, epochs end."""
    graph, loops = driven(260, 90, seed=5)
    kept, held = [graph], {node for e in loops for node in (e.node_a, e.node_b)}
    free = [node for node in range(1, 259) if node not in held]
    for k, loop in enumerate(loops):
        for twin in kept:
            twin.add_edge(loop)
            if k % 9 == 4:
                twin.remove_edge(loops[k - 2].id)
            if k % 20 == 10:
                _let_go(twin, free[k])
            twin.optimise(0)
        if k in (0, 20, 30, 31, 32, 50, 80):
            kept.append(decode(encode(graph), PoseGraph))
    assert len({bits(twin) for twin in kept}) == 1
    assert graph.factors() == set(graph.edges)


def _let_go(graph: PoseGraph, node: int) -> None:
    """Take a keyframe out; one step leads over it."""
    into, on = sorted(
        (e for e in graph.edges_at(node) if e.kind == "sequential"), key=lambda e: e.node_b
    )
    over = Edge(
        on.id, on.kind, into.node_a, on.node_b, into.T_a_b @ on.T_a_b, 0.5 * INFORMATION, False
    )
    graph.remove_nodes([node], instead=[over])


def test_what_leaves_is_as_if_it_had_never_been_there() -> None:
    graph, loops = driven(260, 30, seed=6)
    rest, _ = driven(260, 30, seed=6)
    for k, loop in enumerate(loops):
        graph.add_edge(loop)
        if k % 2:
            rest.add_edge(loop)
    for g in (graph, rest):
        g.optimise(0)
    for loop in loops[::2]:
        graph.remove_edge(loop.id)
    graph.optimise(0)
    assert off(graph.settled(), rest.settled()) < 1e-6
    assert off(graph, rest) < 0.03


def test_a_component_that_falls_apart_is_two_and_becomes_one_again() -> None:
    graph, _ = driven(300, 0, seed=7)
    graph.optimise(0)
    cut = graph.remove_edge("s150+0")
    for twin in ways(graph):
        assert not twin.is_solved(3)
        twin.optimise(3)
        twin.optimise(200)
        assert twin.factors() == set(twin.edges)
        twin.add_edge(cut)
        twin.optimise(200)
        assert twin.factors() == set(twin.edges)
        assert twin.component_root(299) == 0


def test_a_trial_changes_nothing_and_is_gone_on_from() -> None:
    graph, _ = driven(170, 0, seed=8)
    other, _ = driven(170, 0, first=500, seed=9)
    for node, pose in other.nodes.items():
        graph.add_node(node, pose)
    for edge in other.edges.values():
        graph.add_edge(edge)
    for node in (0, 500):
        graph.optimise(node)
    before, T_A_B = bits(graph), Pose(4.0, -2.0, 1.0)
    rng = np.random.default_rng(1)
    meetings = []
    for k in (3, 50, 120):
        T = perturbed(graph.pose(k).between(T_A_B @ graph.pose(500 + k)), rng)
        meetings.append(Edge(f"m{k}", "rendezvous", k, 500 + k, T, INFORMATION, True))
    trial = graph.solve_joined(0, 500, T_A_B, meetings)
    assert bits(graph) == before
    graph.move_component(500, T_A_B)
    plain = decode(encode(graph), PoseGraph)
    for g in (graph, plain):
        for edge in meetings:
            g.add_edge(edge)
    graph.adopt(trial)
    plain.optimise(0)
    assert graph.factors() == set(graph.edges)
    rest = {k: pose for k, pose in trial.poses.items() if k}  # but the anchor, which stays
    assert {k: graph.pose(k) for k in rest} == rest
    assert off(graph, plain) < 0.02
    assert len({bits(twin) for twin in ways(graph)}) == 1
    extra = Edge(
        "later", "rendezvous", 80, 580, graph.pose(80).between(graph.pose(580)), INFORMATION, True
    )
    for twin in ways(graph):
        twin.add_edge(extra)
        twin.optimise(0)
        assert twin.factors() == set(twin.edges)


def test_poses_that_are_far_off_come_to_rest_all_the_same() -> None:
    """Where the tree does not, damping does, and a new tree goes on from there."""
    graph, loops = driven(330, 60, seed=10)
    rng = np.random.default_rng(11)
    graph._poses.rows[1:] = se2.compose(
        graph._poses.rows[1:], rng.normal(0.0, (3.0, 3.0, 1.0), (329, 3))
    )
    for loop in loops:
        graph.add_edge(loop)
    graph.optimise(0)
    assert graph.factors() == set(graph.edges)
    assert off(graph, graph.settled()) < 0.03


def test_drift_needs_an_optimised_graph() -> None:
    graph, _ = driven(10, 0)
    with pytest.raises(KeyError):
        graph.drift([1, 4])
