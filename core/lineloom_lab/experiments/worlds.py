"""The worlds of chapter 6, drawn to the sizes that the text gives.

The text's own worlds (Fig. 6.2, 6.9) are pictures without measures: only sizes are the same.
"""

from __future__ import annotations

import math

from lineloom_lab.simulation import World
from lineloom_lab.simulation.blueprint import Blueprint

MAP_SIZE_M = (14.0, 7.0)
"""The map of Fig. 6.2: 14 m x 7 m (§6.2)."""

CORNER_WALL_M = 31.0
"""Length of both walls of `wall_corner`: no beam of the run passes their far ends."""


def two_rooms() -> World:
    """A floor of 14 m x 7 m (§6.2): two rooms with a wide passage along y = 0, furnished.

    Lower left inner corner at the origin; walls seen from inside lie exactly on the 14 x 7 m.
    """
    width, height = MAP_SIZE_M
    plan = Blueprint("two-rooms")
    plan.outline(
        [
            *((0.0, 0.0), (5.2, 0.0), (5.2, 0.3), (6.4, 0.3), (6.4, 0.0), (width, 0.0)),
            *((width, 3.2), (13.6, 3.2), (13.6, 4.3), (width, 4.3), (width, height)),
            *((11.2, height), (11.2, 6.7), (9.6, 6.7), (9.6, height), (0.0, height)),
        ]
    )
    plan.box((7.0, 4.8), 0.2, 4.4)  # the wall between the rooms hangs from the top
    plan.box((0.2, 3.4), 0.4, 1.6)  # a cupboard, two tables, a column, a chest
    plan.box((3.3, 3.6), 1.0, 1.8)
    plan.box((10.4, 3.5), 1.6, 0.8, math.radians(25.0))
    plan.box((12.2, 2.6), 0.4, 0.4)
    plan.box((2.6, 6.85), 1.4, 0.3)
    return plan.world()


def wall_corner() -> World:
    """Two walls of 31 m that meet at a right angle in the origin (§6.3.2, Fig. 6.9).

    They open towards -x, so that a robot that comes along the x axis drives straight into the
    corner and sees both walls, and nothing else, all the way.
    """
    plan = Blueprint("wall-corner")
    reach = CORNER_WALL_M * math.sqrt(0.5)
    plan.line((-reach, -reach), (0.0, 0.0))
    plan.line((0.0, 0.0), (-reach, reach))
    return plan.world()
