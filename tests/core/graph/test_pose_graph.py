"""The container: components, removal, residuals, pickling."""

from __future__ import annotations

import pickle

import networkx as nx
import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.graph import Edge, PoseGraph

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
        assert list(graph.components()) == expected
        node = int(rng.integers(60))
        assert graph.component_of(node) in expected
        assert graph.component_root(node) == graph.component_of(node)[0]
        other = int(rng.integers(60))
        assert graph.connected(node, other) == nx.has_path(reference, node, other)


def test_subgraph_holds_the_edges_inside_only() -> None:
    graph = chain([0, 1, 2, 3, 4])
    for a, b in [(0, 1), (1, 2), (3, 4)]:
        graph.add_edge(link(a, b))
    poses, edges = graph.subgraph([1, 2, 3])
    assert list(poses) == [1, 2, 3]
    assert [e.id for e in edges] == ["1-2"]
    poses, edges = graph.component_subgraph(2)
    assert list(poses) == [0, 1, 2]
    assert [e.id for e in edges] == ["0-1", "1-2"]


def test_residual_is_the_whitened_norm() -> None:
    graph = chain([0, 1])
    graph.add_edge(link(0, 1, Pose(0.9, 0.0, 0.0)))
    assert graph.residual("0-1") == pytest.approx(1.0)
    assert graph.residuals() == {"0-1": pytest.approx(1.0)}
    assert graph.residual(link(0, 1, Pose(1.0, 0.0, 0.1))) == pytest.approx(2.0, rel=1e-2)


def test_moving_a_component_keeps_its_residuals_and_leaves_others() -> None:
    graph = chain([0, 1, 2])
    graph.add_edge(link(0, 1, Pose(0.9, 0.1, 0.2)))
    before, third = graph.residual("0-1"), graph.nodes[2]
    graph.move_component(1, Pose(5.0, -3.0, 2.0))
    assert graph.residual("0-1") == pytest.approx(before)
    assert graph.nodes[0].x == pytest.approx(5.0)
    assert graph.nodes[2] == third


def test_removing_a_node_takes_its_edges() -> None:
    graph = chain([0, 1, 2])
    graph.add_edge(link(0, 1))
    graph.add_edge(link(1, 2))
    assert [e.id for e in graph.remove_node(1)] == ["0-1", "1-2"]
    assert graph.components() == ((0,), (2,))
    assert not graph.edges


def test_pickles_to_the_same() -> None:
    graph = chain([0, 1, 2])
    graph.add_edge(link(0, 1))
    twin = pickle.loads(pickle.dumps(graph))
    twin.add_edge(link(1, 2))
    assert twin.components() == ((0, 1, 2),)
    assert graph.components() == ((0, 1), (2,))
    assert dict(twin.nodes) == dict(graph.nodes)


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
        graph.set_poses({9: Pose.identity()})
    with pytest.raises(ValueError, match="itself"):
        link(3, 3)
    with pytest.raises(ValueError, match="symmetric"):
        Edge("e", "loop", 0, 1, Pose.identity(), np.triu(np.ones((3, 3))), True)
    with pytest.raises(ValueError, match="3x3"):
        Edge("e", "loop", 0, 1, Pose.identity(), np.full((3, 3), np.nan), True)
