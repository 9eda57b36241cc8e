"""Pose graphs to solve: random ones, and a robot's laps."""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph import Edge, PoseGraph
from lineloom_core.graph.edge import EdgeKind
from lineloom_core.graph.growth import Growth
from numpy.typing import NDArray

STEP_SIGMA = (0.02, 0.02, 0.005)
INFORMATION: NDArray[np.float64] = np.diag([2500.0, 2500.0, 40000.0])


def random_information(rng: np.random.Generator) -> NDArray[np.float64]:
    """Some information, correlated."""
    L = rng.normal(size=(3, 3))
    return np.asarray(L @ L.T * 300.0 + np.diag([200.0, 200.0, 1000.0]))


def random_component(
    rng: np.random.Generator, count: int, loops: int, *, noise: float = 1.0, wrong: int = 0
) -> tuple[Growth, NDArray[np.float64]]:
    """A tree over `count` nodes and loops between any two of them; and the true poses.

    Trees of chains, branches and stars; edges either way round. Edges are off by
    `noise` times what they say, the start by half of that; the last `wrong` loops are nonsense.
    """
    truth = np.column_stack([rng.uniform(-9.0, 9.0, (count, 2)), rng.uniform(-3.0, 3.0, count)])
    pairs = [(max(i - int(rng.geometric(0.6)), 0), i) for i in range(1, count)]
    while len(pairs) < count - 1 + loops:
        a, b = rng.integers(0, count, 2).tolist()
        if a != b:
            pairs.append((a, b))
    edges = []
    for k, pair in enumerate(pairs):
        a, b = pair if rng.random() < 0.7 else pair[::-1]
        off = noise * rng.normal(0.0, STEP_SIGMA)
        if k >= max(len(pairs) - wrong, count - 1):
            off = off + rng.uniform(1.0, 3.0, 3)
        T = se2.compose(se2.between(truth[a], truth[b]), off)
        kind: EdgeKind = "loop" if k >= count - 1 else "sequential"
        I = random_information(rng)  # noqa: E741
        edges.append(Edge(f"e{k}", kind, a, b, Pose.from_array(T), I, kind == "loop"))
    start = se2.compose(truth, 0.5 * noise * rng.normal(0.0, STEP_SIGMA, (count, 3)))
    return Growth.of(np.arange(count), start, edges), truth


def edges_of(component: Growth) -> list[Edge]:
    """A component's edges as objects."""
    return [
        Edge(name, "loop" if robust else "sequential", a, b, Pose(*T), information, robust)
        for name, (a, b), T, information, robust in zip(
            component.names,
            component.ends.tolist(),
            component.measured.tolist(),
            component.information,
            component.robust.tolist(),
            strict=True,
        )
    ]


def components_of(graph: PoseGraph) -> tuple[tuple[int, ...], ...]:
    """The connected sets of nodes, each sorted, ordered by their smallest nodes."""
    members: dict[int, list[int]] = {}
    for node in sorted(graph.nodes):
        members.setdefault(graph.component_root(node), []).append(node)
    return tuple(tuple(members[root]) for root in sorted(members))


def laps(n: int, loops: int, seed: int, wrong: int = 0) -> tuple[list[Pose], list[Edge]]:
    """A robot driving laps of 80 m; loop edges between passes; the last `wrong` are nonsense."""
    rng = np.random.default_rng(seed)
    steps = [Pose(0.5, 0.0, math.pi / 2 if i % 40 == 0 else 0.0) for i in range(1, n)]
    truth = [Pose.identity()]
    for step in steps:
        truth.append(truth[-1] @ step)
    edges = [
        Edge(f"s{i}", "sequential", i - 1, i, perturbed(step, rng), INFORMATION, False)
        for i, step in enumerate(steps, start=1)
    ]
    for k in range(loops):
        i = int(rng.integers(0, n - 160))
        T = perturbed(truth[i].between(truth[i + 160]), rng)
        if k >= loops - wrong:
            T = T @ Pose(3.0, -2.0, 0.8)
        edges.append(Edge(f"l{k}", "loop", i, i + 160, T, INFORMATION, True))
    return truth, edges


def perturbed(pose: Pose, rng: np.random.Generator) -> Pose:
    """The pose as it may be measured."""
    return pose @ Pose.from_array(rng.normal(0.0, STEP_SIGMA))


def dead_reckoning(n: int, edges: list[Edge]) -> dict[int, Pose]:
    """Where the first n - 1 edges lead, one after the other."""
    poses = {0: Pose.identity()}
    for edge in edges[: n - 1]:
        poses[edge.node_b] = poses[edge.node_a] @ edge.T_a_b
    return poses
