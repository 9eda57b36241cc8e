"""Worlds of round things: where lines alone do not tell where one is."""

from __future__ import annotations

import math

import numpy as np

from lineloom_lab.simulation.blueprint import Blueprint
from lineloom_lab.simulation.world import World

SIDES = 32
"""A column of 0.3 m with so many sides is round to 1.5 mm."""


def column_corridor(
    seed: int = 0,
    *,
    length: float = 80.0,
    width: float = 4.0,
    radius: tuple[float, float] = (0.12, 0.16),
    walls: bool = True,
) -> World:
    """Return two parallel walls along x with columns between them, irregularly spaced.

    radius: least and greatest radius of the columns [m], each of its own. Without `walls` there
    are only the columns. The corridor has no ends: the walls alone never tell how far along one is.
    """
    rng = np.random.default_rng(seed)
    plan = Blueprint("column-corridor")
    if walls:
        plan.line((-0.5 * length, 0.0), (0.5 * length, 0.0))
        plan.line((0.5 * length, width), (-0.5 * length, width))
    x = -0.4 * length
    while x < 0.4 * length:
        side = 0.22 if rng.random() < 0.5 else 0.78
        y = width * (side + float(rng.uniform(-0.05, 0.05)))
        plan.pillar((x, y), float(rng.uniform(*radius)), SIDES)
        x += float(rng.uniform(1.0, 2.4))
    return plan.world()


def round_hall(seed: int = 0, *, radius: float = 6.0, columns: int = 7) -> World:
    """Return a round hall about the origin, its wall round to 7 mm, with columns standing in it.

    The columns' radii and places are drawn; the middle (2.5 m) stays free. Without columns every
    direction in the hall looks alike.
    """
    rng = np.random.default_rng(seed)
    plan = Blueprint("round-hall")
    plan.pillar((0.0, 0.0), radius, 2 * SIDES)
    for k in range(columns):
        bearing = math.tau * (k + float(rng.uniform(-0.25, 0.25))) / columns
        distance = float(rng.uniform(2.8, radius - 1.2))
        centre = (distance * math.cos(bearing), distance * math.sin(bearing))
        plan.pillar(centre, float(rng.uniform(0.2, 0.4)), SIDES)
    return plan.world()
