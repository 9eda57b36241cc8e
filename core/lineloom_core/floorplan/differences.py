"""What a building has that its plan has not, and the other way round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.floorplan.fit import CONFIRMED, MISSING, UNSEEN, Judge
from lineloom_core.floorplan.plan import lengths
from lineloom_core.floorplan.samples import Samples
from lineloom_core.geometry import Pose

_LEAST_PIECE_M = 0.4
"""Shorter pieces are door leaves, window frames and the ends of walls."""


@dataclass(frozen=True, eq=False)
class Differences:
    """All in the plan's frame, rows x1, y1, x2, y2 [m].

    missing: walls of the plan in whose place free space was seen, and on both of their sides. new:
    mapped walls that the plan does not have; new_of (k,): the index of the map's line that each is
    a piece of. confirmed, unseen: walls of the plan that are there, and those that nobody has seen.
    """

    missing: NDArray[np.float64]
    new: NDArray[np.float64]
    new_of: NDArray[np.int64]
    confirmed: NDArray[np.float64]
    unseen: NDArray[np.float64]


def differences(judge: Judge, T_plan_map: Pose) -> Differences:
    """Compare at a registered pose.

    Missing and new walls shorter than 0.4 m are left out.
    """
    states = judge.states(T_plan_map)
    states[(states == MISSING) & ~judge.seen_through(T_plan_map)] = UNSEEN
    missing, _ = _pieces(judge.plan, states == MISSING)
    confirmed, _ = _pieces(judge.plan, states == CONFIRMED)
    unseen, _ = _pieces(judge.plan, (states != MISSING) & (states != CONFIRMED))
    off, of = _pieces(judge.site, ~judge.on_plan(T_plan_map))
    new = T_plan_map.transform(off.reshape(-1, 2)).reshape(-1, 4)
    long = lengths(new) >= _LEAST_PIECE_M
    return Differences(
        missing=missing[lengths(missing) >= _LEAST_PIECE_M],
        new=new[long],
        new_of=of[long],
        confirmed=confirmed,
        unseen=unseen,
    )


def _pieces(
    samples: Samples, chosen: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return runs of chosen neighbours on one line as segments (k, 4), and their lines (k,)."""
    index = np.flatnonzero(chosen)
    if len(index) == 0:
        return np.empty((0, 4)), np.empty(0, dtype=np.int64)
    line = samples.line[index]
    starts = np.ones(len(index), dtype=np.bool_)
    starts[1:] = (np.diff(index) != 1) | (np.diff(line) != 0)
    first = index[starts]
    last = index[np.append(np.flatnonzero(starts)[1:], len(index)) - 1]
    half = 0.5 * samples.weight
    along = np.column_stack([np.cos(samples.direction), np.sin(samples.direction)])
    begin = samples.points[first] - half[first, None] * along[first]
    end = samples.points[last] + half[last, None] * along[last]
    return np.hstack([begin, end]), samples.line[first]
