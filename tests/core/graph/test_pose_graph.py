"""The container: components, removal, residuals, pickling."""

from __future__ import annotations

import itertools

import networkx as nx
import numpy as np
import pytest
from lineloom_core.codec import decode, encode
from lineloom_core.geometry import Pose
from lineloom_core.graph import Edge, PoseGraph

from tests.core.graph.graphs import components_of

INFORMATION = np.diag([100.0, 100.0, 400.0])


def link(a: int, b: int, T: Pose | None = None) -> Edge:
    return Edge(f"{a}-{b}", "sequential", a, b, T or Pose(1.0, 0.0, 0.0), INFORMATION, False)


def chain(nodes: list[int]) -> PoseGraph:
    graph = PoseGraph()
    for i, node in enumerate(nodes):
        graph.add_node(node, Pose(float(i), 0.0, 0.0))
    return graph


def test_components_against_networkx_while_edges_come_and_go() -> None:
    rng = np.random.default_rng(0)
    graph, reference = chain(list(range(60))), nx.Graph()
    reference.add_nodes_from(range(60))
    for _ in range(300):
        if graph.edges and rng.random() < 0.4:
            edge = graph.remove_edge(list(graph.edges)[int(rng.integers(len(graph.edges)))])
            reference.remove_edge(edge.node_a, edge.node_b)
        else:
            a, b = sorted(rng.choice(60, 2, replace=False).tolist())
            if f"{a}-{b}" in graph.edges:
                continue
            graph.add_edge(link(a, b))
            reference.add_edge(a, b)
        expected = sorted(tuple(sorted(c)) for c in nx.connected_components(reference))
        assert list(components_of(graph)) == expected
        node = int(rng.integers(60))
        (inside,) = (component for component in expected if node in component)
        assert graph.component_root(node) == inside[0]
        other = int(rng.integers(60))
        assert graph.connected(node, other) == nx.has_path(reference, node, other)


def test_optimising_leaves_other_components_and_the_anchor_alone() -> None:
    graph = chain([5, 3, 1])
    graph.add_edge(link(5, 1))
    graph.optimise(5)
    assert graph.pose(1) == Pose(2.0, 0.0, 0.0)
    assert graph.pose(5).distance(Pose(1.0, 0.0, 0.0)) < 1e-9
    assert graph.pose(3) == Pose(1.0, 0.0, 0.0)


def test_what_is_near_is_of_the_same_component_and_nearest_first() -> None:
    graph = chain(list(range(9)))
    for a, b in itertools.pairwise(range(8)):
        graph.add_edge(link(a, b))
    graph.add_node(20, Pose(3.2, 0.0, 1.0))
    assert graph.within(3, 2.0) == [(2, 1.0), (4, 1.0), (1, 2.0), (5, 2.0)]
    assert graph.within(8, 3.0) == []
    graph.add_edge(link(20, 0))
    assert [node for node, _ in graph.within(3, 1.0)] == [20, 2, 4]


def test_residual_is_the_whitened_norm() -> None:
    graph = chain([0, 1])
    graph.add_edge(link(0, 1, Pose(0.9, 0.0, 0.0)))
    assert graph.residuals() == {"0-1": pytest.approx(1.0)}
    graph.add_edge(Edge("turned", "loop", 1, 0, Pose(-1.0, 0.0, 0.1), INFORMATION, True))
    assert graph.residuals()["turned"] == pytest.approx(2.0, rel=1e-2)


def test_moving_a_component_keeps_its_residuals_and_leaves_others() -> None:
    graph = chain([0, 1, 2])
    graph.add_edge(link(0, 1, Pose(0.9, 0.1, 0.2)))
    before, third = graph.residuals()["0-1"], graph.nodes[2]
    graph.move_component(1, Pose(5.0, -3.0, 2.0))
    assert graph.residuals()["0-1"] == pytest.approx(before)
    assert graph.nodes[0].x == pytest.approx(5.0)
    assert graph.nodes[2] == third


def test_edges_at_a_node_go_with_them() -> None:
    graph = chain([0, 1, 2])
    graph.add_edge(link(0, 1))
    graph.add_edge(link(1, 2))
    assert [e.id for e in graph.edges_at(1)] == ["0-1", "1-2"]
    graph.remove_edge("0-1")
    assert [e.id for e in graph.edges_at(1)] == ["1-2"]
    assert graph.edges_at(0) == ()


def arrays(graph: PoseGraph) -> list[list[object]]:
    state = graph.__getstate__()
    return [
        state[name].tolist()
        for name in ("ids", "poses", "labels", "ends", "measured", "information", "robust")
    ]


def test_a_graph_that_nodes_and_edges_left_is_as_if_they_had_never_been_there() -> None:
    rng = np.random.default_rng(3)
    for _ in range(30):
        whole, rest = chain(list(range(12))), PoseGraph()
        pairs = [sorted(rng.choice(12, 2, replace=False).tolist()) for _ in range(16)]
        edges = {f"{a}-{b}": link(a, b, Pose(*rng.normal(size=3).tolist())) for a, b in pairs}
        for edge in edges.values():
            whole.add_edge(edge)
        gone = set(rng.choice(12, int(rng.integers(0, 12)), replace=False).tolist())
        unlinked = next((e.id for e in edges.values() if not gone & {e.node_a, e.node_b}), None)
        removed = whole.remove_nodes(gone)
        assert {e.id for e in removed} == {
            e.id for e in edges.values() if gone & {e.node_a, e.node_b}
        }
        if unlinked is not None:
            assert whole.remove_edge(unlinked).id == unlinked
        for node in sorted(set(range(12)) - gone):
            rest.add_node(node, Pose(float(node), 0.0, 0.0))
        for edge in edges.values():
            if edge not in removed and edge.id != unlinked:
                rest.add_edge(edge)
        for twin in (whole, decode(encode(whole), PoseGraph)):
            assert list(twin.edges) == list(rest.edges)
            assert components_of(twin) == components_of(rest)
            assert arrays(twin) == arrays(rest)
            for node in rest.nodes:
                assert [e.id for e in twin.edges_at(node)] == [e.id for e in rest.edges_at(node)]
            twin.add_node(99, Pose(1.0, 2.0, 3.0))
            assert twin.pose(99) == Pose(1.0, 2.0, 3.0)


def test_comes_back_the_same() -> None:
    graph = chain([0, 1, 2])
    graph.add_edge(link(0, 1))
    twin = decode(encode(graph), PoseGraph)
    twin.add_edge(link(1, 2))
    assert components_of(twin) == ((0, 1, 2),)
    assert components_of(graph) == ((0, 1), (2,))
    assert dict(twin.nodes) == dict(graph.nodes)


@pytest.mark.parametrize(
    "field", ["poses", "labels", "ends", "measured", "information", "drift", "names"]
)
def test_columns_that_do_not_fit_each_other_are_refused(field: str) -> None:
    graph = chain([0, 1, 2])
    graph.add_edge(link(0, 1))
    state = graph.__getstate__()
    state[field] = state[field][:0]
    with pytest.raises(ValueError, match=r"zip|broadcast"):
        PoseGraph.__new__(PoseGraph).__setstate__(state)


def test_mistakes_are_named() -> None:
    graph = chain([0, 1])
    graph.add_edge(link(0, 1))
    with pytest.raises(ValueError, match="already"):
        graph.add_edge(link(0, 1))
    with pytest.raises(ValueError, match="already"):
        graph.add_node(0, Pose.identity())
    with pytest.raises(KeyError, match="7"):
        graph.add_edge(link(0, 7))
    with pytest.raises(KeyError, match="nope"):
        graph.remove_edge("nope")
    with pytest.raises(KeyError, match="9"):
        graph.pose(9)
    with pytest.raises(ValueError, match="itself"):
        link(3, 3)
    with pytest.raises(ValueError, match="symmetric"):
        Edge("e", "loop", 0, 1, Pose.identity(), np.triu(np.ones((3, 3))), True)
    with pytest.raises(ValueError, match="3x3"):
        Edge("e", "loop", 0, 1, Pose.identity(), np.full((3, 3), np.nan), True)
