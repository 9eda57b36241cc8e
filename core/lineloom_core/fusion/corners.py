"""Corners: where the end of one wall and the beginning of the next are one point.

With free sides on the left, one goes along the walls of a room from end to beginning. Two walls
meet where their lines cross, if both reach nearly there and nobody looks through what is missing.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lineloom_core.fusion.occupancy import Rays
from lineloom_core.fusion.persistence import PersistenceConfig, piece_balances

REACH_M = 0.3
"""How far from where the lines cross an end may lie."""

SURE_M = 0.12
"""So little may be missing without asking whether anybody looks through it."""

_LEAST_SINE = math.sin(math.radians(20.0))
_MOST_OVERSHOOT_M = 0.15
_LEAST_LEFT_M = 0.1


def close_corners(
    lines: NDArray[np.float64], rays: Rays, config: PersistenceConfig
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the lines (m, 4) with corners closed, and which of their ends are in one (m, 2).

    An end is in one corner at most, the nearest. What is missing of walls is closed where it is
    little, or where no beam went through it.
    """
    lines, met = lines.copy(), np.zeros((len(lines), 2), dtype=np.bool_)
    ends, begins, at, missing = corners(lines)
    open_to_view = _seen_through(lines, ends, begins, at, missing, rays, config)
    for k in range(len(ends)):
        i, j = int(ends[k]), int(begins[k])
        if met[i, 1] or met[j, 0] or open_to_view[k]:
            continue
        # Trimmed at both ends a short line may come to nothing.
        if _left(lines[i, :2], at[k], lines[i]) and _left(at[k], lines[j, 2:], lines[j]):
            lines[i, 2:] = lines[j, :2] = at[k]
            met[i, 1] = met[j, 0] = True
    return lines, met


def _left(begin: NDArray[np.float64], end: NDArray[np.float64], line: NDArray[np.float64]) -> bool:
    """Whether something is left of a line that is to go from `begin` to `end`."""
    along = line[2:] - line[:2]
    return bool((end - begin) @ along > _LEAST_LEFT_M * math.hypot(along[0], along[1]))


def _seen_through(
    lines: NDArray[np.float64],
    ends: NDArray[np.int64],
    begins: NDArray[np.int64],
    at: NDArray[np.float64],
    missing: NDArray[np.float64],
    rays: Rays,
    config: PersistenceConfig,
) -> NDArray[np.bool_]:
    """Whether beams go through what is missing at a corner: (k,)."""
    found = np.zeros(len(ends), dtype=np.bool_)
    long = missing > SURE_M
    added = np.vstack(
        [
            np.hstack([lines[ends, 2:], at])[long[:, 0]],
            np.hstack([at, lines[begins, :2]])[long[:, 1]],
        ]
    )
    balances = [float(b.min()) for b in piece_balances(added, rays, config)]
    of = np.concatenate([np.flatnonzero(long[:, 0]), np.flatnonzero(long[:, 1])])
    for k, balance in zip(of.tolist(), balances, strict=True):
        found[k] |= balance < 1.0
    return found


def corners(
    lines: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Return where lines (m, 4) may meet, nearest first: line that ends, line that begins, where
    (k, 2), and how much is missing of each (k, 2) [m], less than 0 where it reaches too far.
    """
    if len(lines) < 2:
        none = np.empty(0, dtype=np.int64)
        return none, none, np.empty((0, 2)), np.empty((0, 2))
    ends, begins = cKDTree(lines[:, 2:]), cKDTree(lines[:, :2])
    pairs = [
        (i, j)
        for i, near in enumerate(ends.query_ball_tree(begins, 2.0 * REACH_M))
        for j in near
        if i != j
    ]
    if not pairs:
        none = np.empty(0, dtype=np.int64)
        return none, none, np.empty((0, 2)), np.empty((0, 2))
    i, j = np.array(pairs, dtype=np.int64).T
    u, v = _directions(lines[i]), _directions(lines[j])
    sine = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    away = lines[j, :2] - lines[i, 2:]
    crossing = np.abs(sine) >= _LEAST_SINE
    safe = np.where(crossing, sine, 1.0)
    missing_u = (away[:, 0] * v[:, 1] - away[:, 1] * v[:, 0]) / safe
    missing_v = -(away[:, 0] * u[:, 1] - away[:, 1] * u[:, 0]) / safe
    at = lines[i, 2:] + missing_u[:, None] * u
    possible = crossing
    for missing in (missing_u, missing_v):
        possible &= (missing <= REACH_M) & (missing >= -_MOST_OVERSHOOT_M)
    order = np.argsort((np.abs(missing_u) + np.abs(missing_v))[possible], kind="stable")
    kept = np.flatnonzero(possible)[order]
    return i[kept], j[kept], at[kept], np.column_stack([missing_u, missing_v])[kept]


def _directions(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    d = lines[:, 2:] - lines[:, :2]
    directions: NDArray[np.float64] = d / np.hypot(d[:, 0], d[:, 1])[:, None]
    return directions
