"""From the surfaces that keyframes saw to the walls of a plan: one line a wall face.

Steps of `find_walls`:
 1. lines that keyframes saw are merged where they lie on each other (`merge`), first within the
    lines' own uncertainty, then within that of poses, where they overlap: two surfaces of one side
    cannot stand closely behind each other, for nobody would see the rear one;
 2. collinear lines are one wall;
 3. each point of every keyframe goes to the wall that it lies on (`assign`); walls of points that
    stronger ones explain, such as chords across a corner, go;
 4. each wall is the line that its keyframes agree on: how far they lie apart in fact counts, not
    what each promises (`fit`);
 5. a wall reaches where two keyframes saw it (`stretches`); what one alone saw is told apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.fusion import _wall_kernels as kernels
from lineloom_core.fusion.merge import FusionConfig
from lineloom_core.fusion.segment_map import LineObservations
from lineloom_core.fusion.stretches import (
    BIN_M,
    NO_STRETCHES,
    Stretches,
    covered_from,
    named,
    stretches_of,
)
from lineloom_core.fusion.wall_candidates import MOST_GATE_M, candidates
from lineloom_core.fusion.wall_fit import fitted

_LEAST_COSINE = math.cos(math.radians(30.0))
_CELL_M = 0.3
_SAMPLED = 3
_SPAN_M = 0.5
_MOST_EXPLAINED = 0.5


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What k keyframes saw, n points in all, surface by surface.

    poses (k, 3) in the map. begins (k + 1,): keyframe i owns points[begins[i] : begins[i + 1]].
    points, normals (n, 2) in the laser's frame [m]; a normal of zeros is unknown. beams (n,): of
    each point its number in the sweep.
    """

    poses: NDArray[np.float64]
    begins: NDArray[np.int64]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    beams: NDArray[np.int64]


def find_walls(
    observations: LineObservations, surfaces: Surfaces, config: FusionConfig
) -> Stretches:
    """Return the stretches of wall that keyframes saw, wall by wall; none for no observations."""
    walls, of = candidates(observations, config)
    if not len(walls):
        return NO_STRETCHES
    places = _assigned(surfaces, walls, every=_SAMPLED)
    kept = (places.tally[:, 0] > 0) & (places.tally[:, 1] <= _MOST_EXPLAINED * places.tally[:, 0])
    number = np.full(len(walls) + 1, -1, dtype=np.int64)  # -1 reads the last
    number[:-1][kept] = np.arange(np.count_nonzero(kept))
    walls, of = walls[kept], number[of]
    if not len(walls):
        return NO_STRETCHES
    places = _assigned(surfaces, walls)
    rows = kernels.said_by_keyframe(
        surfaces.begins, places.label, places.along, places.across, len(walls)
    )
    fit = fitted(rows, len(walls))
    low, bins = covered_from(walls)
    counts = np.zeros(int(bins[-1]), dtype=np.int64)
    kernels.cover(
        surfaces.begins, surfaces.beams, places.label, places.along, places.across, fit.line,
        fit.reach, low, bins, BIN_M, _SPAN_M, counts,
    )  # fmt: skip
    return stretches_of(walls, fit, rows, counts, named(observations, of, walls), config)


@dataclass(frozen=True, eq=False)
class _Places:
    """Of each point its wall, and its place along and across that; tally as in `assign`."""

    label: NDArray[np.int64]
    along: NDArray[np.float64]
    across: NDArray[np.float64]
    tally: NDArray[np.int64]


def _assigned(surfaces: Surfaces, walls: NDArray[np.float64], every: int = 1) -> _Places:
    """Step 3: the wall of each point."""
    n = len(surfaces.points)
    places = _Places(
        np.empty(n, np.int64), np.zeros(n), np.zeros(n), np.zeros((len(walls), 2), np.int64)
    )
    reach = kernels.SLACK_M + MOST_GATE_M + _CELL_M
    a = walls[:, :2] + walls[:, kernels.LOW, None] * walls[:, 2:4]
    b = walls[:, :2] + walls[:, kernels.HIGH, None] * walls[:, 2:4]
    ends = np.vstack([a, b])
    (ox, oy), (hx, hy) = ends.min(axis=0) - reach, ends.max(axis=0) + reach
    columns, rows = int((hx - ox) / _CELL_M) + 1, int((hy - oy) / _CELL_M) + 1
    starts, members = kernels.enter(walls, ox, oy, _CELL_M, columns, rows)
    kernels.assign(
        surfaces.poses, surfaces.begins, surfaces.points, surfaces.normals, walls, starts, members,
        ox, oy, _CELL_M, columns, rows, _LEAST_COSINE, every,
        places.label, places.along, places.across, places.tally,
    )  # fmt: skip
    return places
