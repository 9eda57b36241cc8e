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

from lineloom_core.fusion import _persistence_kernels as kernels
from lineloom_core.fusion.occupancy import Rays


@dataclass(frozen=True, slots=True)
class PersistenceConfig:
    """Parameters; metres.

    piece: length of a line's pieces, each judged by itself. reach: how far a sweep counts. near,
    far: a beam that ends less than `near` off the line (measured across it) has seen it; one that
    ends more than `far` behind has passed through. loss: what passing through takes from the
    balance, where seeing adds 1; less than 1, for beams pass through glass at times. most: where
    the balance saturates. least_hole: shorter gaps between pieces that are left are not cut out.
    most_sweeps, most_looks: the latest that are asked, and that count; they bound the cost.
    """

    piece: float = 0.25
    reach: float = 8.0
    near: float = 0.15
    far: float = 0.3
    loss: float = 0.5
    most: float = 6.0
    least_hole: float = 0.45
    least_length: float = 0.2
    most_sweeps: int = 200
    most_looks: int = 40


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
