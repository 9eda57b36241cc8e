"""Furniture for worlds that are drawn without any, and parts of worlds that are too large."""

from __future__ import annotations

import math

import numpy as np

from lineloom_lab.simulation.blueprint import Blueprint
from lineloom_lab.simulation.free_space import FreeSpace
from lineloom_lab.simulation.world import World

_PASSAGE_M = 0.8


def cluttered(space: FreeSpace, rng: np.random.Generator, *, pieces_per_m2: float = 0.06) -> World:
    """Return the world with tables, cabinets and pillars where they leave a way on all sides.

    pieces_per_m2: tried per square metre of reachable floor; what would block a way is left out.
    """
    world, drawn = space.world, Blueprint("clutter")
    for _ in range(round(pieces_per_m2 * space.area)):
        x, y = space.random_point(rng)
        length, width = float(rng.uniform(0.4, 1.8)), float(rng.uniform(0.3, 0.8))
        reach = 0.5 * math.hypot(length, width)
        if world.clearance(x, y, cap=reach + _PASSAGE_M) < reach + _PASSAGE_M:
            continue
        if rng.random() < 0.25:
            drawn.pillar((x, y), 0.5 * width, 8)
        else:
            drawn.box((x, y), length, width, float(rng.choice([0.0, rng.uniform(0.0, math.pi)])))
        world = space.world.with_walls(drawn.segments)
    return world


def cropped(world: World, side: float, rng: np.random.Generator) -> World | None:
    """Return the walls that touch a square of `side` [m] somewhere in the world; None for none.

    A world that is smaller is returned whole.
    """
    x0, y0, x1, y1 = world.bounds
    if max(x1 - x0, y1 - y0) <= side:
        return world
    low = np.array([_draw(rng, x0, x1 - side), _draw(rng, y0, y1 - side)])
    a, b = world.walls[:, :2], world.walls[:, 2:]
    touches = np.all((np.maximum(a, b) >= low) & (np.minimum(a, b) <= low + side), axis=1)
    return World(world.walls[touches], world.name) if touches.any() else None


def _draw(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high)) if high > low else low
