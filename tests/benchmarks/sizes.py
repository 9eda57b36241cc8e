"""`python -m tests.benchmarks.sizes`: how the mapper's cost grows, one row per size of the map."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.graph import Edge, Piece, PoseGraph, settle
from lineloom_core.graph.solver import levenberg_marquardt
from lineloom_core.mapping.config import PlaceConfig
from lineloom_core.places import Place, PlaceIndex, recognise
from lineloom_core.warm_up.drive import warm_up
from lineloom_lab.simulation import sick_lms200

from tests.benchmarks.long_drive import growth_along_a_drive, solving_row
from tests.benchmarks.row import Row, median_seconds, table
from tests.benchmarks.scans import DATA
from tests.core.places.conftest import office_stretches


def growth(data: Path, *, quick: bool) -> list[Row]:
    """A new place among n, a graph of n keyframes, and scans at the n-th keyframe of a drive."""
    sizes = (100,) if quick else (100, 300, 1000)
    stretches = office_stretches(sick_lms200(), 4 if quick else 16)
    made = [m.place for s in stretches for m in (s.forth, s.again, s.back)]
    rows = [_recognition(made, size) for size in sizes]
    rows += [_solving(size) for size in ((100,) if quick else (100, 300, 1000, 3000))]
    return rows + growth_along_a_drive(data, quick=quick)


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
    return Row.of_times(
        f"place, new among {size}",
        each,
        150.0,
        "every place in full (from 60 pairs)",
        brute,
        f"a shortlist of {most}, each compared in full",
    )


def _solving(size: int) -> Row:
    """A robot goes round the same loop again and again; the newest loop is off by 2 cm."""
    graph, information = PoseGraph(), np.diag([1e4, 1e4, 1e5])
    rng, step = np.random.default_rng(size), Pose(0.4, 0.0, 2.0 * np.pi / 100)
    graph.add_node(0, Pose.identity())
    for k in range(1, size):
        T = step @ Pose(*rng.normal(0.0, (0.004, 0.004, 0.001)).tolist())
        graph.add_node(k, graph.pose(k - 1) @ T)
        graph.add_edge(Edge(f"s{k}", "sequential", k - 1, k, T, information, False))
        if k >= 100 and k % 4 == 0:
            here = Pose.identity()
            graph.add_edge(Edge(f"l{k}", "loop", k - 100, k, here, information, True))
    _solve(graph)
    newest = Pose(0.02, 0.0, 0.0)
    graph.add_edge(Edge("new", "loop", max(size - 101, 0), size - 1, newest, information, True))
    piece = graph.piece(0)
    ours = median_seconds(lambda _: _solve(graph, piece), range(5))
    return solving_row(
        f"graph, {size} keyframes solved after one more loop",
        ours,
        median_seconds(lambda _: levenberg_marquardt(piece, 0), range(3)),
        "a loop at every fourth keyframe; not every keyframe asks for it",
    )


def _solve(graph: PoseGraph, start: Piece | None = None) -> None:
    """What `SiteMap.optimise` does, beginning at the poses of `start` if there is one."""
    if start is not None:
        graph.take_poses(start, start.poses)
    piece = graph.piece(0)
    graph.take_poses(piece, settle(piece, held=0))


def main() -> None:
    """Measure and print what grows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the real data")
    options = parser.parse_args()
    warm_up()
    print(table(growth(options.data, quick=False)))


if __name__ == "__main__":
    main()
