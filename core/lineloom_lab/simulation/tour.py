"""Who goes where: tours that share the work of seeing a building and still meet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from lineloom_core.geometry import Pose
from numpy.typing import NDArray

from lineloom_lab.simulation.planner import Planner

_SPACING_M = 2.5
_TRIES = 600
_STRAY_M = 0.5
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

    A common way of `shared` * budget_m leads from place to place in the middle of all starts.
    Every other place belongs to the robot that starts nearest. A robot first visits places of its
    own, then drives the whole common way from its nearer end, then visits the rest of its own.
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
    common = _common_way(table, robots, shared * budget_m)
    spare = set(range(robots, len(points))) - set(common)
    owner = np.argmin(table[:robots], axis=0)
    tours = []
    for robot, pose in enumerate(poses):
        own = {k for k in spare if owner[k] == robot}
        order = _order(table, robot, own, spare - own, common, budget_m)
        stops = [points[order[0]], *(_beside(planner, points[k], rng) for k in order[1:])]
        tours.append((pose.theta, np.array(stops)))
    return tours


def _beside(
    planner: Planner, point: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Move a stop a little where there is room: no two robots drive in the same track."""
    space = planner.space
    for _ in range(8):
        moved: NDArray[np.float64] = point + rng.uniform(-_STRAY_M, _STRAY_M, size=2)
        if space.world.is_move_free(point, moved, space.radius + space.cell):
            return moved
    return point


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


def _common_way(table: NDArray[np.float64], robots: int, length_m: float) -> list[int]:
    """Return places to be visited by all, nearest next, along at least `length_m` metres.

    It begins at the place whose farthest robot has the shortest way to it.
    """
    if length_m <= 0.0:
        return []
    way = [robots + int(np.argmin(np.max(table[:robots, robots:], axis=0)))]
    left, length = set(range(robots, len(table))) - set(way), 0.0
    while left and length < _MARGIN * length_m:
        step = _nearest(table, way[-1], left)
        length += float(table[way[-1], step])
        way.append(step)
        left.discard(step)
    return way


def _nearest(table: NDArray[np.float64], here: int, candidates: set[int]) -> int:
    return min(candidates, key=lambda k: (float(table[here, k]), k))


def _order(
    table: NDArray[np.float64],
    start: int,
    own: set[int],
    others: set[int],
    common: list[int],
    budget_m: float,
) -> list[int]:
    """Order the places of one robot: own, the common way, own again, then everybody's, anew."""
    order, length = [start], 0.0

    def visit(place: int) -> None:
        nonlocal length
        length += float(table[order[-1], place])
        order.append(place)

    left = set(own)
    if common:
        first, last = common[0], common[-1]
        of_common = sum(float(table[a, b]) for a, b in pairwise(common))
        # As much of its own after the common way as before it, the way there counted.
        while left and length + min(table[order[-1], [first, last]]) < 0.5 * (budget_m - of_common):
            visit(_nearest(table, order[-1], left))
            left.discard(order[-1])
        forward = table[order[-1], first] <= table[order[-1], last]
        for place in common if forward else reversed(common):
            visit(place)
    while length < _MARGIN * budget_m:
        left = left or (own | others | set(common)) - {order[-1]}
        if not left:
            break
        visit(_nearest(table, order[-1], left))
        left.discard(order[-1])
    return order
