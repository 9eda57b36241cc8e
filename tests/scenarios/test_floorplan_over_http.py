"""A building as its owner has it: drive, PUT the plan, use the map in the plan's coordinates."""

from __future__ import annotations

import io
import math
import zipfile
from pathlib import Path

import httpx
import numpy as np
import pytest
import yaml
from lineloom import Client
from lineloom.calls import MapOptions
from lineloom.cli.child_service import ChildService
from lineloom.cli.player import Player
from lineloom.cli.simulate import due
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import Fleet
from PIL import Image

pytestmark = pytest.mark.scenario


def test_a_mapped_office_is_served_in_its_floor_plans_coordinates(tmp_path: Path) -> None:
    fleet = Fleet.office(seed=0, robots=1, duration_s=60.0)
    robot = fleet.robots[0]
    walls = "\n".join(", ".join(map(str, wall)) for wall in fleet.world.walls.tolist())
    with ChildService(tmp_path / "data") as service:
        service.wait_until_ready()
        with Client(service.url, timeout=120.0) as client:
            Player(client, "office", batch=200).play(due(fleet, "0"))
            client.wait_until_idle("office")
            answer = client.put_floorplan("office", walls.encode(), "text/plain")
            (place,) = answer.components
            assert place.verdict == "registered", place.reason
            assert place.T_plan_map is not None
            # The map's frame is that of the first scan, whose true pose the simulator knows.
            truth = next(iter(robot.scans())).true_pose
            T = Pose(place.T_plan_map.x, place.T_plan_map.y, place.T_plan_map.theta)
            off = truth.between(T)
            assert math.hypot(off.x, off.y) < 0.1
            assert abs(off.theta) < math.radians(0.5)
            grid = client.export("office", "nav2", MapOptions(frame="plan"))
            archive = zipfile.ZipFile(io.BytesIO(client.export_file("office", grid.id)))
            about = yaml.safe_load(archive.read("map.yaml"))
            grey = np.asarray(Image.open(io.BytesIO(archive.read("map.pgm"))))[::-1]
            # Where the robot truly drove, in the plan's coordinates, the map is free.
            way = robot.drive.positions(np.arange(0.0, 55.0, 0.5))
            cells = np.floor((way - about["origin"][:2]) / about["resolution"]).astype(int)
            free = grey[cells[:, 1], cells[:, 0]] == 254
            assert free.mean() > 0.97
            # And so is every pose.
            path = f"{service.url}/v1/sites/office/robots/{robot.name}/trajectory?frame=plan"
            poses = httpx.get(path, trust_env=False).json()["poses"]
            driven = np.array([s.true_pose.to_array() for s in robot.scans()])
            placed = np.array([(p["x"], p["y"]) for p in poses])
            rows = [p["seq"] for p in poses]
            assert np.hypot(*(placed - driven[rows, :2]).T).max() < 0.25
            found = client.floorplan_differences("office")
            assert sum(math.hypot(p.x2 - p.x1, p.y2 - p.y1) for p in found.missing) < 3.0
            assert b"pieces of wall" in client.floorplan_drawing("office")
        service.stop()
        service.start()
        service.wait_until_ready()
        with Client(service.url, timeout=120.0) as client:
            client.wait_until_idle("office")
            # Plan and export are on disk; the place in the plan is found again.
            assert client.floorplan("office").components[0].verdict == "registered"
            assert client.exports("office").exports[0].id == grid.id
