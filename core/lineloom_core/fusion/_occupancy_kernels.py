"""Rays and lines into a grid. Documented twin in the tests: test_occupancy.slow_cast."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.kernels import kernel

Array = NDArray[np.float64]
Counts = NDArray[np.uint16]

_MOST = 65_000  # where a cell's count stops


@kernel(nogil=True)
def walk(counts: Counts, ax: float, ay: float, bx: float, by: float) -> None:
    """Count every cell that the segment a to b, in units of cells, passes through.

    Amanatides and Woo 1987. counts: (rows, columns), x along columns.
    """
    rows, columns = counts.shape
    x, y = math.floor(ax), math.floor(ay)
    end_x, end_y = math.floor(bx), math.floor(by)
    dx, dy = bx - ax, by - ay
    step_x = 1 if dx > 0.0 else -1
    step_y = 1 if dy > 0.0 else -1
    wide_x = abs(1.0 / dx) if dx != 0.0 else np.inf
    wide_y = abs(1.0 / dy) if dy != 0.0 else np.inf
    next_x = (x + (1 if dx > 0.0 else 0) - ax) / dx if dx != 0.0 else np.inf
    next_y = (y + (1 if dy > 0.0 else 0) - ay) / dy if dy != 0.0 else np.inf
    for _ in range(abs(end_x - x) + abs(end_y - y) + 1):
        if 0 <= x < columns and 0 <= y < rows and counts[y, x] < _MOST:
            counts[y, x] += 1
        if next_x < next_y:
            x += step_x
            next_x += wide_x
        else:
            y += step_y
            next_y += wide_y


@kernel(nogil=True)
def cast(
    poses: Array,
    sweeps: Array,
    starts: NDArray[np.int64],
    ranges: Array,
    ox: float,
    oy: float,
    cell: float,
    hits: Counts,
    passes: Counts,
) -> None:
    """Count where beams end and what they pass, for every scan.

    poses (k, 3): of the lasers in the grid's frame. sweeps (k, 2): angle_min, increment. starts
    (k + 1,): scan i has ranges[starts[i] : starts[i + 1]]. Beams without a finite return say
    nothing. A beam is free up to one cell before its end: what grazes a wall does not open it.
    """
    rows, columns = hits.shape
    for i in range(poses.shape[0]):
        px, py = (poses[i, 0] - ox) / cell, (poses[i, 1] - oy) / cell
        for beam in range(starts[i], starts[i + 1]):
            r = ranges[beam]
            if not math.isfinite(r):
                continue
            angle = poses[i, 2] + sweeps[i, 0] + sweeps[i, 1] * (beam - starts[i])
            c, s = math.cos(angle), math.sin(angle)
            reach = r / cell
            x, y = math.floor(px + reach * c), math.floor(py + reach * s)
            if 0 <= x < columns and 0 <= y < rows and hits[y, x] < _MOST:
                hits[y, x] += 1
            if reach > 1.0:
                walk(passes, px, py, px + (reach - 1.0) * c, py + (reach - 1.0) * s)
