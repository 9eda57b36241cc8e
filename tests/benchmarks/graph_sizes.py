"""What the pose graph costs by its number of keyframes: growing, asking, settling, restoring.

A robot goes round the same loop again and again; every fourth keyframe closes a loop to the round
before. Each cost is held against that of the optimum of the whole graph, worked out at once.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from statistics import median
from time import process_time

import numpy as np
from lineloom_core.codec import decode, encode
from lineloom_core.geometry import Pose
from lineloom_core.graph import Edge, PoseGraph

from tests.benchmarks.row import Row

_INFORMATION = np.diag([1e4, 1e4, 1e5])
_ROUND = 100
_EVERY = 4
_SMALL = 3000
_AT_ONCE = 10
"""Keyframes in a growth: so many come between two loops of a real drive."""


def graph_rows(size: int) -> list[Row]:
    """Rows for one more keyframe, loop, removal, join, covariances, settling and restoring."""
    graph = laps(size)
    whole = _seconds(graph.settled)
    stored = encode(graph)

    def row(what: str, seconds: float, most_ms: float | None = None, note: str = "") -> Row:
        name = f"graph, {size} keyframes: {what}"
        return Row.of_times(name, seconds, most_ms, "the whole at once", whole, note)

    small = size <= _SMALL
    loop, asked = (5.0, 30.0) if small else (60.0, None)
    return [
        row("one more keyframe", _median(lambda k: _step(graph, size + k)), loop),
        row("one more loop, 2 cm off", _median(lambda k: _loop(graph, k)), loop),
        row("a loop removed", _median(lambda k: _unloop(graph, k)), 60.0),
        row("64 candidates' covariances", _covariances(graph, size), asked),
        row("two of half its size joined", _join(size), None, "the trial, and going on from it"),
        row("settled", whole, None, "exact; beside the mapper"),
        row("restored", _seconds(lambda: _loop(decode(stored, PoseGraph), 9)), None, "one loop on"),
    ]


def laps(size: int, first: int = 0) -> PoseGraph:
    """A graph that has grown as the mapper has it grow; keyframes from `first` on."""
    graph, rng = PoseGraph(), np.random.default_rng(size)
    step = Pose(0.4, 0.0, 2.0 * np.pi / _ROUND)
    graph.add_node(first, Pose.identity())
    for k in range(first + 1, first + size):
        T = step @ Pose(*rng.normal(0.0, (0.004, 0.004, 0.001)).tolist())
        graph.add_node(k, graph.pose(k - 1) @ T)
        graph.add_edge(Edge(f"s{k}", "sequential", k - 1, k, T, _INFORMATION, False))
        if k - first >= _ROUND and k % _EVERY == 0:
            off = Pose(*rng.normal(0.0, (0.004, 0.004, 0.001)).tolist())
            graph.add_edge(Edge(f"l{k}", "loop", k - _ROUND, k, off, _INFORMATION, True))
        if k % max(_AT_ONCE, size // 50) == 0:
            graph.optimise(k)
    graph.optimise(first)
    return graph


def _step(graph: PoseGraph, k: int) -> None:
    T = Pose(0.4, 0.0, 2.0 * np.pi / _ROUND)
    graph.add_node(k, graph.pose(k - 1) @ T)
    graph.add_edge(Edge(f"s{k}", "sequential", k - 1, k, T, _INFORMATION, False))
    graph.optimise(k)


def _loop(graph: PoseGraph, k: int) -> None:
    newest = max(graph.nodes) - k
    edge = Edge(
        f"new{k}", "loop", newest - _ROUND, newest, Pose(0.02, 0.0, 0.0), _INFORMATION, True
    )
    graph.add_edge(edge)
    graph.optimise(newest)


def _unloop(graph: PoseGraph, k: int) -> None:
    graph.remove_edge(f"new{k}")
    graph.optimise(0)


def _covariances(graph: PoseGraph, size: int) -> float:
    graph.drift([0, 1])  # the tree is there, as it is after the first question
    nodes = np.linspace(0, size - 1, 64).astype(int).tolist()
    return _median(lambda _: graph.drift(nodes))


def _join(size: int) -> float:
    graph = laps(size // 2)
    other = laps(size // 2, first=size // 2)
    for node, pose in other.nodes.items():
        graph.add_node(node, pose)
    for edge in other.edges.values():
        graph.add_edge(edge)
    graph.optimise(size // 2)
    meetings = [
        Edge(f"m{k}", "rendezvous", k, size // 2 + k, Pose(0.01, 0.0, 0.0), _INFORMATION, True)
        for k in (3, 30, 60)
    ]
    begin = process_time()
    trial = graph.solve_joined(0, size // 2, Pose.identity(), meetings)
    for edge in meetings:
        graph.add_edge(edge)
    graph.adopt(trial)
    return process_time() - begin


def _median(work: Callable[[int], object]) -> float:
    """Median CPU time [s] of a few runs, of which the first does not count."""
    runs = [_seconds(functools.partial(work, k)) for k in range(6)]
    return median(runs[1:])


def _seconds(call: Callable[[], object]) -> float:
    begin = process_time()
    call()
    return process_time() - begin
