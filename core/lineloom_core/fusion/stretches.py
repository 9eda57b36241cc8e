"""Where walls are: from where to where keyframes saw them, and what each stretch is called."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.fusion import _wall_kernels as kernels
from lineloom_core.fusion.merge import FusionConfig
from lineloom_core.fusion.segment_map import LineObservations
from lineloom_core.fusion.wall_fit import Fit

BIN_M = 0.02
"""What coverage of a wall is counted in."""

_HOLE, _ONCE_HOLE = 3, 25  # bins
_NOBODY = np.iinfo(np.int64).max


@dataclass(frozen=True, eq=False)
class Named:
    """Observations on their walls: wall (n,), middle (n,) along it [m], id (n,), ascending."""

    wall: NDArray[np.int64]
    middle: NDArray[np.float64]
    id: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Stretches:
    """m stretches of wall, several of one wall where it has openings.

    endpoints (m, 4), free side on the left. begin, end (m,): from where to where along its wall
    [m]. wall (m,): number of the wall; stretches of one wall lie on one line. id (m,): of the
    oldest observation whose middle lies in the stretch, wall_id (m,) of the oldest of its wall; a
    stretch that holds the middle of none has -1. sigma (m,): of the position across at its middle
    [m]. once (m,): a single keyframe saw it. rows: see `_wall_kernels.said_by_keyframe`.
    """

    endpoints: NDArray[np.float64]
    begin: NDArray[np.float64]
    end: NDArray[np.float64]
    wall: NDArray[np.int64]
    id: NDArray[np.int64]
    wall_id: NDArray[np.int64]
    sigma: NDArray[np.float64]
    once: NDArray[np.bool_]
    rows: NDArray[np.float64]

    def __len__(self) -> int:
        return int(self.endpoints.shape[0])

    def seen_by(
        self, of: NDArray[np.int64], begin: NDArray[np.float64], end: NDArray[np.float64]
    ) -> list[NDArray[np.int64]]:
        """Return which keyframes (places among the surfaces') saw parts of stretches.

        of (p,): the stretches; begin, end (p,): of each part, from the start of its stretch [m].
        """
        wall = self.rows[:, kernels.ROW_WALL].astype(np.int64)
        order = np.argsort(wall, kind="stable")
        bounds = np.searchsorted(wall[order], [self.wall[of], self.wall[of] + 1])
        since, until = self.begin[of] + begin, self.begin[of] + end
        found = []
        for k, (first, last) in enumerate(bounds.T.tolist()):
            mine = self.rows[order[first:last]]
            touching = mine[:, kernels.ROW_LOW] < until[k]
            touching &= mine[:, kernels.ROW_HIGH] > since[k]
            found.append(mine[touching, kernels.ROW_FRAME].astype(np.int64))
        return found


_NO_METRES, _NO_NUMBERS = np.empty(0), np.empty(0, dtype=np.int64)

NO_STRETCHES = Stretches(
    endpoints=np.empty((0, 4)),
    begin=_NO_METRES,
    end=_NO_METRES,
    wall=_NO_NUMBERS,
    id=_NO_NUMBERS,
    wall_id=_NO_NUMBERS,
    sigma=_NO_METRES,
    once=np.empty(0, dtype=np.bool_),
    rows=np.empty((0, kernels.ROW_COLUMNS)),
)


def covered_from(walls: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return from where on walls (m, WALL_COLUMNS) are counted, (m,) [m], and their first bins.

    The latter (m + 1,), the last being their number.
    """
    low = walls[:, kernels.LOW] - kernels.SLACK_M
    bins = ((walls[:, kernels.HIGH] + kernels.SLACK_M - low) / BIN_M).astype(np.int64) + 1
    return low, np.concatenate([[0], np.cumsum(bins)])


def named(
    observations: LineObservations, of: NDArray[np.int64], walls: NDArray[np.float64]
) -> Named:
    """Return the observations on walls, by age. of (n,): the wall of each, -1 for none."""
    on = np.flatnonzero(of >= 0)
    on = on[np.argsort(observations.id[on], kind="stable")]
    wall, ends = of[on], observations.endpoints[on]
    away = 0.5 * (ends[:, :2] + ends[:, 2:]) - walls[wall, kernels.CX : kernels.CY + 1]
    middle = (away * walls[wall, kernels.UX : kernels.UY + 1]).sum(axis=1)
    return Named(wall, middle, observations.id[on])


def stretches_of(
    walls: NDArray[np.float64],
    fit: Fit,
    rows: NDArray[np.float64],
    counts: NDArray[np.int64],
    seen: Named,
    config: FusionConfig,
) -> Stretches:
    """Return the stretches of walls (m, WALL_COLUMNS) by where they were seen, oldest wall first.

    counts: see `_wall_kernels.cover`, as `covered_from` lays it out.
    """
    low, bins = covered_from(walls)
    runs = kernels.runs(
        counts, bins, _HOLE, _ONCE_HOLE, round(config.end_slack / BIN_M),
        math.ceil(config.min_length / BIN_M - 1e-9),
    )  # fmt: skip
    alone = (runs[:, 2] - runs[:, 1]) * BIN_M >= config.min_length_alone - 1e-9
    runs = runs[alone | (runs[:, 3] == 0)]
    if not len(runs):
        return NO_STRETCHES
    oldest = np.full(len(walls), _NOBODY)
    np.minimum.at(oldest, seen.wall, seen.id)
    runs = runs[np.lexsort((runs[:, 1], oldest[runs[:, 0]]))]
    wall = runs[:, 0]
    begin, end = (low[wall] + runs[:, c] * BIN_M for c in (1, 2))
    middle, C = 0.5 * (begin + end), fit.covariance[wall]
    return Stretches(
        endpoints=np.hstack([_on(walls[wall], fit.line[wall], t) for t in (begin, end)]),
        begin=begin,
        end=end,
        wall=wall,
        id=_names(wall, begin, end, seen),
        wall_id=oldest[wall],
        sigma=np.sqrt(C[:, 0, 0] + 2.0 * middle * C[:, 0, 1] + middle**2 * C[:, 1, 1]),
        once=runs[:, 3] > 0,
        rows=rows,
    )


def _on(
    walls: NDArray[np.float64], line: NDArray[np.float64], t: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the points at t [m] on fitted lines, (n, 2)."""
    u = walls[:, kernels.UX : kernels.UY + 1]
    across = (line[:, 0] + line[:, 1] * t)[:, None] * np.column_stack([-u[:, 1], u[:, 0]])
    point: NDArray[np.float64] = walls[:, kernels.CX : kernels.CY + 1] + t[:, None] * u + across
    return point


def _names(
    wall: NDArray[np.int64], begin: NDArray[np.float64], end: NDArray[np.float64], seen: Named
) -> NDArray[np.int64]:
    """Name each stretch after the oldest observation whose middle lies in it.

    So a name stays with its place as the wall grows, and when an opening parts it.
    """
    names = np.full(len(wall), -1, dtype=np.int64)
    order = np.lexsort((begin, wall))
    # One ascending key of walls and places along them: no wall is anywhere near so long.
    far = 1e6
    keys = wall[order] * far + begin[order]
    at = np.searchsorted(keys, seen.wall * far + seen.middle, side="right") - 1
    stretch = order[np.maximum(at, 0)]
    inside = (at >= 0) & (wall[stretch] == seen.wall) & (seen.middle <= end[stretch])
    first, where = np.unique(stretch[inside], return_index=True)  # observations come by age
    names[first] = seen.id[inside][where]
    return names
