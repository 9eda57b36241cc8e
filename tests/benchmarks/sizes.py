"""`python -m tests.benchmarks.sizes`: how the mapper's cost grows, one row per size of the map."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
from lineloom_core.mapping.config import PlaceConfig
from lineloom_core.places import Place, PlaceIndex, recognise
from lineloom_core.warm_up.drive import warm_up
from lineloom_lab.simulation import sick_lms200

from tests.benchmarks.graph_sizes import graph_rows
from tests.benchmarks.long_drive import growth_along_a_drive
from tests.benchmarks.row import Row, table
from tests.benchmarks.scans import DATA
from tests.core.places.conftest import office_stretches


def growth(data: Path, *, quick: bool) -> list[Row]:
    """A new place among n, a graph of n keyframes, and scans at the n-th keyframe of a drive."""
    sizes = (100,) if quick else (100, 300, 1000)
    stretches = office_stretches(sick_lms200(), 4 if quick else 16)
    made = [m.place for s in stretches for m in (s.forth, s.again, s.back)]
    rows = [_recognition(made, size) for size in sizes]
    keyframes = (300,) if quick else (300, 1000, 3000, 10_000, 30_000)
    rows += [row for size in keyframes for row in graph_rows(size)]
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


def main() -> None:
    """Measure and print what grows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the real data")
    options = parser.parse_args()
    warm_up()
    print(table(growth(options.data, quick=False)))


if __name__ == "__main__":
    main()
