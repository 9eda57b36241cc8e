"""Seeded worlds, lidars and robots: the fixture behind the tests and the demo."""

from lineloom_core.simulation.buildings import (
    corridors,
    long_corridor,
    rectangle,
    rooms,
    world_named,
    world_names,
)
from lineloom_core.simulation.free_space import FreeSpace
from lineloom_core.simulation.lidar import Lidar, scanner_360, sick_lms200
from lineloom_core.simulation.office import office_floor
from lineloom_core.simulation.world import World

__all__ = [
    "FreeSpace",
    "Lidar",
    "World",
    "corridors",
    "long_corridor",
    "office_floor",
    "rectangle",
    "rooms",
    "scanner_360",
    "sick_lms200",
    "world_named",
    "world_names",
]
