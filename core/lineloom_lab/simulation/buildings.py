"""The built-in worlds, by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lineloom_lab.simulation.blueprint import WALL_THICKNESS_M, Blueprint
from lineloom_lab.simulation.furniture import (
    LABORATORY,
    LOUNGE,
    MEETING,
    OFFICE,
    Room,
    duct,
    furnish,
    shelf,
)
from lineloom_lab.simulation.office import office_floor
from lineloom_lab.simulation.world import World


def rectangle(width: float = 8.0, height: float = 5.0) -> World:
    """Return one empty room of width x height [m], its lower left corner at the origin."""
    plan = Blueprint("rectangle")
    plan.outline([(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)])
    return plan.world()


def long_corridor(length: float = 45.0, width: float = 2.2, spacing: float = 3.0) -> World:
    """Return a straight corridor along x that looks the same every `spacing` metres.

    Door niches, 1 m wide and 0.25 m deep, lie opposite one another; both ends are alike. Nothing
    tells one stretch from the next: the hardest place to be recognised in.
    """
    plan = Blueprint("long-corridor")
    draw_niched_corridor(plan, length, width, spacing)
    return plan.world()


def draw_niched_corridor(plan: Blueprint, length: float, width: float, spacing: float) -> None:
    """Draw the outline of `long_corridor`, its lower left corner at the origin."""
    count = int((length - 2.0) // spacing) + 1
    first = 0.5 * (length - (count - 1) * spacing)
    for wall, out in ((0.0, -0.25), (width, 0.25)):
        at = 0.0
        for i in range(count):
            a, b = first + i * spacing - 0.5, first + i * spacing + 0.5
            plan.line((at, wall), (a, wall))
            plan.line((a, wall), (a, wall + out))
            plan.line((a, wall + out), (b, wall + out))
            plan.line((b, wall + out), (b, wall))
            at = b
        plan.line((at, wall), (length, wall))
    plan.line((0.0, 0.0), (0.0, width))
    plan.line((length, 0.0), (length, width))


def rooms(seed: int = 0) -> World:
    """Return four connected rooms, about 14 x 10 m in all, each furnished in another style."""
    rng = np.random.default_rng(seed)
    plan = Blueprint("rooms")
    width, height = float(rng.uniform(13.0, 15.0)), float(rng.uniform(9.0, 11.0))
    x_low, x_high = width * rng.uniform(0.38, 0.62, size=2)
    y = height * float(rng.uniform(0.42, 0.58))
    h = 0.5 * WALL_THICKNESS_M
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    for i, corner in enumerate(corners):
        plan.wall(corner, corners[(i + 1) % 4])
    cells = [
        Room((h, h, x_low - h, y - h)),
        Room((x_low + h, h, width - h, y - h)),
        Room((h, y + h, x_high - h, height - h)),
        Room((x_high + h, y + h, width - h, height - h)),
    ]
    low_door, high_door = 0.5 * y, 0.5 * (y + height)
    left_door, right_door = 0.5 * min(x_low, x_high), 0.5 * (max(x_low, x_high) + width)
    plan.wall((x_low, 0.0), (x_low, y), [(low_door - 0.6, low_door + 0.6)])
    plan.wall((x_high, y), (x_high, height), [(high_door - y - 0.5, high_door - y + 0.5)])
    gaps = [(left_door - 0.5, left_door + 0.5), (right_door - 0.6, right_door + 0.6)]
    plan.wall((0.0, y), (width, y), gaps)
    ways = [
        (x_low - 1.3, low_door - 0.9, x_low + 1.3, low_door + 0.9),
        (x_high - 1.3, high_door - 0.9, x_high + 1.3, high_door + 0.9),
        (left_door - 0.9, y - 1.3, left_door + 0.9, y + 1.3),
        (right_door - 0.9, y - 1.3, right_door + 0.9, y + 1.3),
    ]
    for cell, style in zip(cells, (OFFICE, LOUNGE, MEETING, LABORATORY), strict=True):
        cell.keep_free = [(float(a), float(b), float(c), float(d)) for a, b, c, d in ways]
        furnish(plan, cell, rng, style)
    return plan.world()


def corridors(seed: int = 0) -> World:
    """Return three corridors, about 30 x 16 m: two long ones joined in the middle by a short one.

    Ducts and cabinets stand along the walls, at random.
    """
    rng = np.random.default_rng(seed)
    plan = Blueprint("corridors")
    width = float(rng.uniform(2.2, 2.6))
    length, height = float(rng.uniform(28.0, 32.0)), float(rng.uniform(14.0, 18.0))
    x = length * float(rng.uniform(0.3, 0.7))
    a, b, top = x - 0.5 * width, x + 0.5 * width, height - width
    plan.outline(
        [
            *(
                (0.0, 0.0),
                (length, 0.0),
                (length, width),
                (b, width),
                (b, top),
                (length - 4.0, top),
            ),
            *(
                (length - 4.0, height),
                (2.0, height),
                (2.0, top),
                (a, top),
                (a, width),
                (0.0, width),
            ),
        ]
    )
    mouths = [(a - 0.4, 0.0, b + 0.4, 2 * width), (a - 0.4, top - width, b + 0.4, height)]
    spans = [(0.0, 0.0, length, width), (2.0, top, length - 4.0, height), (a, width, b, top)]
    for span, pieces in zip(spans, (6, 5, 2), strict=True):
        leg = Room(span)
        leg.keep_free = [*mouths, (a - 0.4, width, b + 0.4, width + 0.8)]
        furnish(plan, leg, rng, [duct, shelf] * pieces)
    return plan.world()


_BUILDERS: dict[str, Callable[[int], World]] = {
    "corridors": corridors,
    "long-corridor": lambda seed: long_corridor(),
    "office": office_floor,
    "rectangle": lambda seed: rectangle(),
    "rooms": rooms,
}


def world_names() -> tuple[str, ...]:
    """Return the names that `world_named` knows, in order."""
    return tuple(sorted(_BUILDERS))


def world_named(name: str, seed: int = 0) -> World:
    """Return the built-in world of that name; the same seed gives the same world.

    Raises ValueError listing the names for one that is unknown.
    """
    if name not in _BUILDERS:
        raise ValueError(f"no world {name!r}: choose one of {', '.join(world_names())}")
    return _BUILDERS[name](seed)
