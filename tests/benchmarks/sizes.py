"""How the mapper's cost grows: one row per size of the map."""

from __future__ import annotations

from dataclasses import replace
from time import process_time

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.graph import Edge, optimize
from lineloom_core.mapping.config import PlaceConfig
from lineloom_core.places import Place, PlaceIndex, recognise
from lineloom_core.simulation import sick_lms200

from tests.benchmarks.row import Row
from tests.core.places.conftest import office_stretches


def growth(*, quick: bool) -> list[Row]:
    """Recognising a new place among n, and solving a graph of n keyframes."""
    sizes = (100,) if quick else (100, 300, 1000)
    stretches = office_stretches(sick_lms200(), 4 if quick else 16)
    made = [m.place for s in stretches for m in (s.forth, s.again, s.back)]
    rows = [_recognition(made, size) for size in sizes]
    return rows + [_solving(size) for size in ((100,) if quick else (100, 300, 1000, 3000))]


def _recognition(made: list[Place], size: int) -> Row:
    """The places are repeated under new ids: what is measured is the cost, not the recall."""
    places = [replace(made[k % len(made)], id=k) for k in range(size)]
    index, most = PlaceIndex(), PlaceConfig().shortlist
    for place in places:
        index.add(place)
        _ = place.own_conflict
    new = [replace(place, id=-1 - k) for k, place in enumerate(made[:6])]
    index.shortlist(new[0], places, most)
    recognise(places[0], new[0])
    begin = process_time()
    for place in new:
        for other in index.shortlist(place, places, most):
            recognise(other, place)
    each = (process_time() - begin) / len(new)
    sample = np.random.default_rng(0).integers(0, size, 60).tolist()
    begin = process_time()
    for k in sample:
        recognise(places[k], new[k % len(new)])
    brute = (process_time() - begin) / len(sample) * size
    return Row(
        name=f"place, new among {size}",
        figure=1e3 * each,
        unit="ms",
        better="lower",
        goal=150.0,
        baseline="every place in full (from 60 pairs)",
        baseline_figure=1e3 * brute,
        note=f"a shortlist of {most}, each compared in full",
    )


def _solving(size: int) -> Row:
    """A robot goes round the same loop again and again; the newest closure is off by 2 cm."""
    rng = np.random.default_rng(size)
    step = Pose(0.4, 0.0, 2.0 * np.pi / 100)
    nodes, edges = {0: Pose.identity()}, list[Edge]()
    information = np.diag([1e4, 1e4, 1e5])
    for k in range(1, size):
        noise = Pose(*rng.normal(0.0, (0.004, 0.004, 0.001)).tolist())
        edges.append(Edge(f"s{k}", "sequential", k - 1, k, step @ noise, information, False))
        nodes[k] = nodes[k - 1] @ step @ noise
        if k >= 100 and k % 4 == 0:
            edges.append(Edge(f"l{k}", "loop", k - 100, k, Pose.identity(), information, True))
    solved = optimize(nodes, edges, anchors=(0,)).poses
    off = Pose(0.02, 0.0, 0.0)
    edges.append(Edge("new", "loop", max(size - 101, 0), size - 1, off, information, True))
    begin = process_time()
    optimize(solved, edges, anchors=(0,))
    warm = process_time() - begin
    begin = process_time()
    optimize(nodes, edges, anchors=(0,))
    cold = process_time() - begin
    return Row(
        name=f"graph, {size} keyframes solved after one more closure",
        figure=1e3 * warm,
        unit="ms",
        better="lower",
        goal=10.0,
        baseline="from the tracked poses",
        baseline_figure=1e3 * cold,
        note="the whole graph; not every keyframe asks for it",
    )
