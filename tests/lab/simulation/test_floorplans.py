"""Real buildings as worlds: they load, and a robot can drive there."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from lineloom_lab.simulation import FreeSpace, Planner, SimulatedRobot, World, sick_lms200

FOLDER = Path(__file__).resolve().parents[4] / "shared" / "data" / "floorplans"

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no floor plans in {FOLDER}")

SEGMENTS = {
    "AHG1": 5100,
    "GDC1": 1289,
    "GDC3": 5647,  # 6444 lines, 797 of them without length
    "GHC3": 2082,
    "Joydeepb-Home": 79,
    "NSH1": 2046,
}


@pytest.mark.parametrize("name", SEGMENTS)
def test_floor_plans_load(name: str) -> None:
    world = World.from_text(FOLDER / f"{name}.txt")
    assert (world.name, len(world.walls)) == (name, SEGMENTS[name])
    assert np.isfinite(world.bounds).all()


@pytest.mark.parametrize("name", ["AHG1", "Joydeepb-Home"])
def test_a_robot_drives_through_a_real_building(name: str) -> None:
    planner = Planner(FreeSpace.of(World.from_text(FOLDER / f"{name}.txt")))
    world = planner.space.world
    robot = SimulatedRobot.wandering(
        "r", world, lidar=sick_lms200(), seed=1, duration_s=60.0, planner=planner
    )
    way = robot.drive.positions(np.arange(0.0, 60.0, 0.1))
    assert min(world.clearance(x, y, cap=1.0) for x, y in way) >= 0.25 - 1e-9
    assert all(np.isfinite(s.scan.ranges).mean() > 0.7 for s in islice(robot.scans(), 0, None, 25))
