"""What there is to compile, so that several processes can, without running anything.

A test holds this to what a drive through mapper and matcher asks for.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numba import typeof, types

from lineloom_core.matching._sweep import Search, Sweep
from lineloom_core.matching.spots import Latest


@dataclass(frozen=True, slots=True)
class Specialisation:
    """A kernel that Python calls, or a large one that others hold, for these arguments.

    arguments: a letter each: F f (float64), I i (int64), J (int32), H (uint16), U (uint8), B b
    (bool), an array of so many dimensions in C order (r: read only) where a digit follows; S and Q
    for a matcher's Sweep and Search, L for the Latest scans.
    """

    kernel: str
    arguments: str

    @property
    def task(self) -> str:
        """What it is part of: features, health, matching, places or fusion."""
        return self.kernel.partition(".")[0]

    def compile(self) -> None:
        """Compile it with all that it calls, or load it."""
        module, _, name = self.kernel.rpartition(".")
        function = getattr(import_module(f"lineloom_core.{module}"), name)
        function.compile(self.types)

    @property
    def types(self) -> tuple[Any, ...]:
        """The arguments' types."""
        return tuple(_type(code) for code in self.arguments.split())


_SCALARS = {"f": types.float64, "i": types.int64, "b": types.boolean}
_ITEMS = {
    "F": types.float64, "I": types.int64, "J": types.int32, "H": types.uint16, "U": types.uint8,
    "B": types.boolean,
}  # fmt: skip


def _type(code: str) -> Any:
    if code in _SCALARS:
        return _SCALARS[code]
    if code == "S":
        return _SWEEP
    if code == "Q":
        return typeof(Search(0, 0, 0.0, 0, 0.0, 0.0, 0.0, 0, 0, 0, 0))
    if code == "L":
        rows, one = np.zeros((1, 1)), np.zeros(1)
        return typeof(Latest(rows, one, one, rows, rows, np.zeros(1, np.int64)))
    return types.Array(_ITEMS[code[0]], int(code[1]), "C", readonly=code.endswith("r"))


def _sweep() -> Any:
    ranges = np.zeros(1)
    ranges.setflags(write=False)
    rows, indices = np.zeros((1, 1)), np.zeros(1, np.int64)
    ends = np.zeros((1, 1), np.int64)
    return typeof(Sweep(rows, ends, np.zeros((1, 1, 1)), rows, rows, indices, ranges, 0.0, 0.0))


_SWEEP = _sweep()


def _parsed(table: str) -> tuple[Specialisation, ...]:
    rows = (line.split("|") for line in table.strip().splitlines())
    return tuple(Specialisation(kernel.strip(), arguments.strip()) for kernel, arguments in rows)


_PLACE = "F2 I2 F3 F2 F2 F1 F1 F2"

MAPPING = _parsed(f"""
    matching._kernels.settle_proposals           | S S F2 F2 F2 F1 i i F2 F1
    matching._covariance_kernels.scan_noise      | S S F1 f f F2 F2
    features._circle_kernels.find_circles        | F2 I1 B1 F2 i f i
    matching._proposal_kernels.propose           | F2 I2 F3 F2 I2 F3 i i f i f f f
    matching._circle_match_kernels.propose_circles | F2 F2 F2 F2 F2 i i f f
    features._kernels.extract                    | F1r f f f f f f i f i f f
    matching._band_kernels.propose_slides        | S S F2 i F1 i i
    matching._band_kernels.propose_bands         | F2 F2 i i f
    matching._covariance_kernels.fill_covariance | S S F1 f f f f b F2
    matching._kernels.match_sweeps               | S S Q
    places._kernels.match_places                 | {_PLACE} {_PLACE} i i f i f f f f i i i f f
    places._constellation_kernels.match_constellations | {_PLACE} {_PLACE} F2 F2 f i i i f f
    places._constellation_kernels.propose_constellations | F2 F2 f i
    places._constellation_kernels.vote_constellations | F2 F2 f J3
    places._constellation_kernels.find_objects   | F2 f f
    places._constellation_kernels.spans_of       | F2
    places._constellation_kernels.count_common   | F2 F2 F1 f I2
    places._constellation_kernels.lay_on         | F2 F2 I2 i F1
    places._constellation_kernels.are_alike      | F1 F1 f f
    matching._spot_kernels.settle_spots          | J2 F2 f f F2 F2 F1 F2 f i f S L i f f
    matching._wide_search_kernels.search_widely  | U2 f f U2 f f F2 F1 f i
    matching._registration_kernels.register      | J2 F2 f f F2 F2 F1 F1 F1 f f i
    fusion._kernels.merge_pass                   | F2 I1 f f f f
    places._kernels.judge_places                 | F2 F2 F1 F1 F2 F2 F2 F1 F1 F2 F1 i f f F1
    fusion._persistence_kernels.balances         | F2 I1 F2 F2 I1 F1 f f f i i f f F1
    matching._free_space_kernels.judge_pair      | F2 F1r f f F2 F1r f f F1 i f f F1
    places._kernels.tally_sweeps                 | F2 F1 F2 F1 F1 F2 f f F2
    matching._wide_search_kernels.coarse_field   | F2 f f i i
    matching._registration_kernels.build         | F2 F2 B1 I1 F2 f b
    matching._registration_kernels.correlate     | U2 f f F2 F1 f f f f f
    features._kernels.point_normals              | F2 B1 i
    fusion._kernels.extents                      | F2 I1 F2
    fusion._wall_kernels.assign                  | F2 I1 F2 F2 F2 I1 I1 f f f i i f i I1 F1 F1 I2
    fusion._wall_kernels.cover                   | I1 I1 I1 F1 F1 F2 F1 F1 I1 f f I1
    fusion._wall_kernels.runs                    | I1 I1 i i i i
    fusion._wall_kernels.said_by_keyframe        | I1 I1 F1 F1 i
    fusion._wall_kernels.enter                   | F2 f f f i i
    matching._registration_kernels.thin          | F2 f i
    matching._registration_kernels.line_normals  | F2 I1 F2 F2
    matching._hypothesis.turn_information        | f f f f f f
    matching._free_space_kernels.judge_each      | F2 F1 F1r f f f f I1
    matching._free_space_kernels.judge_cloud     | F2 i F1 F2 F1 F1 F2 f f F1
    matching._agreement_kernels.is_apart         | F1 F1
    matching._proposal_kernels.lying_pairs       | F2 F2 F1 f f f
    matching._hypothesis.evidence                | F1
    matching._hypothesis.translation_information | f f f f f f
    places._kernels.place_evidence               | f f f
    health._kernels.bulges                       | F2 I1 F2 f i f f
    health._kernels.profile                      | F1r f f i
    health._kernels.profiles_apart               | F1 F1 i f i
    health._kernels.median_step                  | F1r i
""")
"""What scans are mapped with: the largest first, those last that are made of others."""

REST = _parsed("""
    places._index_kernels.likeness_to_all        | F2 F2 I1 I1 I1 F2 F2 f f i f F1
    places._index_kernels.corners_of             | F2 f f i
    places._index_kernels.short_lines            | F2
    fusion._occupancy_kernels.cast               | F2 F2 I1 F1 f f f H2 H2
    fusion._occupancy_kernels.walk               | H2 f f f f
""")
"""What large sites and pictures of occupancy want as well."""
