"""Who goes where: tours that share the work of seeing a building and still meet."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.simulation.planner import Planner

_SPACING_M = 2.5
_TRIES = 600
_MARGIN = 1.1  # lengths along the grid are up to 8 % too long

Tour = tuple[float, NDArray[np.float64]]
"""Heading at the start [rad] and the stops, shape (n, 2) [m]."""


def places(
    planner: Planner, rng: np.random.Generator, spacing: float = _SPACING_M
) -> NDArray[np.float64]:
    """Spread points over the reachable floor, no two closer than `spacing` [m], shape (n, 2).

    Points well away from walls come first, so that rooms are seen from where people stand.
    """
    space = planner.space
    drawn = np.array([space.random_point(rng) for _ in range(_TRIES)])
    room = np.array([space.world.clearance(x, y, cap=0.8) for x, y in drawn])
    kept: list[NDArray[np.float64]] = []
    for point in drawn[np.argsort(-room, kind="stable")]:
        if all(math.dist(point, other) >= spacing for other in kept):
            kept.append(point)
    return np.array(kept)


def plan_tours(
    planner: Planner,
    robots: int,
    rng: np.random.Generator,
    *,
    budget_m: float,
    shared: float,
    starts: Sequence[Pose] | None = None,
) -> list[Tour]:
    """Plan one tour per robot, each at least `budget_m` metres long.

    Every place belongs to the robot that starts nearest. A robot visits places of its own, then,
    for a share `shared` of its way, the others' places nearest to where it is, then its own again.
    """
    if robots < 1 or not 0.0 <= shared <= 1.0:
        raise ValueError("robots must be at least 1 and shared must lie in [0, 1]")
    spots = places(planner, rng)
    if starts is None:
        poses = _spread_starts(planner, spots, robots, rng)
    elif len(starts) == robots:
        poses = list(starts)
    else:
        raise ValueError(f"{robots} robots need as many starts, not {len(starts)}")
    points = np.vstack([[(p.x, p.y) for p in poses], spots])
    table = planner.distances(points)
    owner = np.argmin(table[:robots, robots:], axis=0)
    tours = []
    for robot, pose in enumerate(poses):
        own = {robots + int(k) for k in np.flatnonzero(owner == robot)}
        others = set(range(robots, len(points))) - own
        order = _order(table, robot, own, others, budget_m, shared)
        tours.append((pose.theta, points[order]))
    return tours


def _spread_starts(
    planner: Planner, spots: NDArray[np.float64], robots: int, rng: np.random.Generator
) -> list[Pose]:
    """Choose starts far from one another: the first at random, each next one farthest away."""
    chosen = [int(rng.integers(len(spots)))]
    nearest = np.full(len(spots), np.inf)
    while len(chosen) < robots:
        latest = spots[chosen[-1]]
        nearest = np.minimum(nearest, np.hypot(*(spots - latest).T))
        chosen.append(int(np.argmax(nearest)))
    return [
        Pose(float(spots[k, 0]), float(spots[k, 1]), float(rng.uniform(-math.pi, math.pi)))
        for k in chosen
    ]


def _order(
    table: NDArray[np.float64],
    start: int,
    own: set[int],
    others: set[int],
    budget_m: float,
    shared: float,
) -> list[int]:
    """Visit own, then others', then own places, always the nearest; begin anew if all are seen."""
    order, length = [start], 0.0
    before, after = 0.5 * (1.0 - shared) * budget_m, 0.5 * (1.0 + shared) * budget_m
    left_own, left_others = set(own), set(others)
    while length < _MARGIN * budget_m:
        if not left_own and not left_others:
            left_own, left_others = own - {order[-1]}, others - {order[-1]}
            if not left_own and not left_others:
                break
        visiting = left_others if before <= length < after else left_own
        pool = visiting or left_others or left_own
        step = min(pool, key=lambda k: (float(table[order[-1], k]), k))
        length += float(table[order[-1], step])
        order.append(step)
        left_own.discard(step)
        left_others.discard(step)
    return order
