"""What is still there: lines fade where later scans look through them, and come back when seen.

People, doors and furniture leave lines behind. A beam that passes through the place of a line
speaks against it; one that ends on it speaks for it; one that ends before it says nothing, so that
nobody makes a wall vanish by standing before it. Each piece of a line has a balance that saturates:
what ten robots have seen outlasts a few doubts, and a door that stays open fades all the same.

Order is the order in which scans were processed: stamps of different robots do not compare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.fusion import _persistence_kernels as kernels
from lineloom_core.fusion.occupancy import Rays
from lineloom_core.parameters import parameter


@storable("persistence-config")
@dataclass(frozen=True, slots=True)
class PersistenceConfig:
    """When a wall that is seen through leaves the map."""

    piece: float = parameter(0.25, "m", "length of a line's pieces, each judged by itself", 0.01)
    reach: float = parameter(8.0, "m", "how far a sweep counts", 0.1)
    near: float = parameter(
        0.15, "m", "a beam that ends less off the line, measured across it, has seen it"
    )
    far: float = parameter(0.3, "m", "a beam that ends more behind it has passed through")
    loss: float = parameter(
        0.5, "", "what passing through takes, where seeing adds 1: there is glass"
    )
    most: float = parameter(6.0, "", "where the balance of a piece saturates")
    least_hole: float = parameter(
        0.45, "m", "shorter gaps between pieces that are left are not cut out"
    )
    least_length: float = parameter(0.2, "m", "shorter remains are dropped")
    most_sweeps: int = parameter(200, "sweeps", "the latest that are asked; bounds the cost", 1)
    most_looks: int = parameter(40, "looks", "the latest that count; bounds the cost", 1)


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of line number `line` that is still there, from `begin` to `end` [m] along it.

    whole: the line from end to end.
    """

    line: int
    begin: float
    end: float
    whole: bool


def lasting_stretches(
    lines: NDArray[np.float64], rays: Rays, config: PersistenceConfig | None = None
) -> list[Stretch]:
    """Return what is left of lines (m, 4), in their order, after all rays in the order given."""
    config = config or PersistenceConfig()
    lengths = np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1])
    found: list[Stretch] = []
    for i, balance in enumerate(piece_balances(lines, rays, config)):
        found += _stretches(i, float(lengths[i]), balance > 0.0, config)
    return found


def piece_balances(
    lines: NDArray[np.float64], rays: Rays, config: PersistenceConfig
) -> list[NDArray[np.float64]]:
    """Return per line the balances of its pieces, from its start to its end."""
    lengths = np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1])
    counts = np.maximum(np.rint(lengths / config.piece), 1.0).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    out = np.empty(int(first[-1]))
    kernels.balances(
        np.ascontiguousarray(lines), first, rays.poses, rays.sweeps, rays.starts, rays.ranges,
        config.reach, config.near, config.far, config.most_sweeps, config.most_looks,
        config.most, config.loss, out,
    )  # fmt: skip
    return np.split(out, first[1:-1]) if len(lines) else []


def _stretches(
    line: int, length: float, left: NDArray[np.bool_], config: PersistenceConfig
) -> list[Stretch]:
    """Runs of pieces that are left; short holes are closed, short remains dropped."""
    if left.all():
        return [Stretch(line, 0.0, length, whole=True)]
    piece = length / len(left)
    hole = math.ceil(config.least_hole / piece - 1e-9)
    kept = np.flatnonzero(left)
    runs: list[list[int]] = []
    for k in kept.tolist():
        if runs and k - runs[-1][1] <= hole:
            runs[-1][1] = k
        else:
            runs.append([k, k])
    if not runs:
        return []
    if runs[0][0] < hole:  # a hole at the end is a hole only if it is long enough as well
        runs[0][0] = 0
    if len(left) - 1 - runs[-1][1] < hole:
        runs[-1][1] = len(left) - 1
    stretches = [(a * piece, (b + 1) * piece) for a, b in runs]
    return [
        Stretch(line, begin, end, whole=end - begin > length - 1e-9)
        for begin, end in stretches
        if end - begin >= config.least_length
    ]
