"""Seeded worlds, lidars, robots and fleets: the fixture behind the tests and the demo.

A world is walls; `FreeSpace` knows where a robot fits and draws random poses; `Planner` and `Drive`
turn stops into motion; `SimulatedRobot` scans on its way; `Fleet` interleaves several robots.
"""

from lineloom_lab.simulation.buildings import (
    corridors,
    long_corridor,
    rectangle,
    rooms,
    world_named,
    world_names,
)
from lineloom_lab.simulation.drive import Drive, Leg
from lineloom_lab.simulation.faults import Blockers, Followers, ScanLoss, Walkers, glazed
from lineloom_lab.simulation.fleet import Fleet
from lineloom_lab.simulation.free_space import FreeSpace
from lineloom_lab.simulation.halls import columned_hall
from lineloom_lab.simulation.lidar import Lidar, scanner_360, sick_lms200
from lineloom_lab.simulation.odometry import DriftingOdometry
from lineloom_lab.simulation.office import office_floor
from lineloom_lab.simulation.planner import Planner
from lineloom_lab.simulation.robot import ROBOT_RADIUS_M, SimulatedRobot, SimulatedScan
from lineloom_lab.simulation.round_buildings import column_corridor, round_hall
from lineloom_lab.simulation.world import World

__all__ = [
    "ROBOT_RADIUS_M",
    "Blockers",
    "DriftingOdometry",
    "Drive",
    "Fleet",
    "Followers",
    "FreeSpace",
    "Leg",
    "Lidar",
    "Planner",
    "ScanLoss",
    "SimulatedRobot",
    "SimulatedScan",
    "Walkers",
    "World",
    "column_corridor",
    "columned_hall",
    "corridors",
    "glazed",
    "long_corridor",
    "office_floor",
    "rectangle",
    "rooms",
    "round_hall",
    "scanner_360",
    "sick_lms200",
    "world_named",
    "world_names",
]
