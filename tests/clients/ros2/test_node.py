"""The node on stand-ins for ROS, against a stand-in for the service: the whole way round."""

from __future__ import annotations

import importlib
import json
import math
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree as ET

import httpx
import numpy as np
import yaml
from lineloom_core.fusion.occupancy import OccupancyGrid
from lineloom_core.io.nav2 import write_map

from tests.clients.fake_service import FakeService
from tests.clients.ros2.fake_ros import installed
from tests.clients.ros2.test_adapter import quaternion, scan

PACKAGE = Path(__file__).resolve().parents[3] / "clients" / "ros2"
ROBOT = "/v1/sites/s/robots/r"


def transform(x: float, yaw: float) -> Any:
    return SimpleNamespace(translation=SimpleNamespace(x=x, y=0.0, z=0.0), rotation=quaternion(yaw))


def until(condition: Any) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline, "nothing came"
        time.sleep(0.01)


def answer_as_mapped(fake: FakeService) -> list[Any]:
    """Have the service put the robot's latest scan at (10, 0), and have a map of one wall."""
    mounts: list[Any] = []
    counts = {"accepted": 1, "processed": 1, "pending": 0}
    robot: dict[str, Any] = {"robot": "r", "site": "s", "state": "starting", "scans": counts}
    robot |= {"health": []}

    def put(request: httpx.Request) -> httpx.Response:
        mounts.append(json.loads(request.content)["mount"])
        return httpx.Response(200, json=robot)

    def get(_request: httpx.Request) -> httpx.Response:
        if not fake.scans:
            return httpx.Response(200, json=robot)
        _, _name, session, seq = max(fake.scans, key=lambda key: key[3])
        pose = {"x": 10.0, "y": 0.0, "theta": 0.0, "covariance": None}
        placed: dict[str, Any] = {"component": "c0", "pose": pose, "state": "tracking"}
        placed |= {"latest_session": session, "latest_seq": seq}
        return httpx.Response(200, json=robot | placed)

    def get_map(request: httpx.Request) -> httpx.Response:
        if request.url.params.get("format") == "nav2":
            grid = OccupancyGrid(np.zeros((2, 3), dtype=np.int8), -1.0, -2.0, 0.05)
            return httpx.Response(200, content=write_map(grid))
        line: dict[str, Any] = {
            "id": "l",
            "component": "c0",
            "x1": 0,
            "y1": 0,
            "x2": 1,
            "y2": 0,
            "sigma": 0.01,
        }
        line |= {"support": 1, "robots": ["r"], "first_seen": 0, "last_seen": 0}
        components = [{"id": "c0", "robots": ["r"]}]
        body: dict[str, Any] = {
            "site": "s",
            "version": 1,
            "components": components,
            "lines": [line],
        }
        return httpx.Response(200, json=body)

    fake.routes["PUT", ROBOT] = put
    fake.routes["GET", ROBOT] = get
    fake.routes["GET", "/v1/sites/s/map"] = get_map
    return mounts


def test_scans_in_transform_grid_and_lines_out(
    tmp_path: Path, loopback: str, fake: FakeService
) -> None:
    mounts = answer_as_mapped(fake)
    settings = {
        "url": loopback,
        "site": "s",
        "robot": "r",
        "queue": str(tmp_path / "queue.db"),
        "pose_period": 0.02,
        "map_period": 0.02,
    }
    with installed(**settings):
        node = importlib.import_module("lineloom_bridge.node").Bridge()
        try:
            node.callbacks["scan"](scan(1.0))  # TF does not know the lidar yet
            assert any("no scans yet" in text for text in node.logger.said)
            node._buffer.known["base_link", "laser"] = transform(0.3, math.pi / 2)
            node._buffer.known["odom", "base_link"] = transform(4.0, 0.0)
            node.callbacks["scan"](scan(2.0))
            until(lambda: mounts)
            assert mounts[0]["x"] == 0.3
            assert fake.scans == {}  # no scan before its mount
            until(lambda: node._link.mounted)
            node.callbacks["scan"](scan(3.0))
            until(lambda: node._transform is not None)
            node.timers_made[0]()
            (sent,) = node._broadcaster.sent
            assert (sent.header.frame_id, sent.child_frame_id) == ("map", "odom")
            assert sent.transform.translation.x == 10.0 - 4.0
            assert sent.header.stamp == 100.2
            until(lambda: node.publishers_by_topic["map"].sent)
            grid = node.publishers_by_topic["map"].sent[0]
            assert (grid.info.width, grid.info.height) == (3, 2)
            assert (grid.info.origin.position.x, grid.info.origin.position.y) == (-1.0, -2.0)
            assert list(grid.data) == [0] * 6
            marker = node.publishers_by_topic["map_lines"].sent[0]
            assert [(p.x, p.y) for p in marker.points] == [(0.0, 0.0), (1.0, 0.0)]
            assert len(marker.colors) == 2
        finally:
            node.close()
    assert len(fake.scans) == 1


def test_the_packaging_names_what_there_is() -> None:
    package = ET.parse(PACKAGE / "package.xml").getroot()
    assert package.findtext("name") == "lineloom_bridge"
    assert package.findtext("export/build_type") == "ament_python"
    depends = {e.text for e in package.findall("exec_depend")}
    node = (PACKAGE / "lineloom_bridge" / "node.py").read_text()
    for module in ("rclpy", "tf2_ros", "geometry_msgs", "nav_msgs", "sensor_msgs", "std_msgs"):
        assert module in depends
        assert f"from {module}" in node
    setup = (PACKAGE / "setup.py").read_text()
    assert "bridge = {NAME}.node:main" in setup
    assert (PACKAGE / "resource" / "lineloom_bridge").exists()


def test_every_parameter_is_in_the_example_with_its_default() -> None:
    with installed():
        defaults = importlib.import_module("lineloom_bridge.node")._DEFAULTS
    listed = yaml.safe_load((PACKAGE / "config" / "bridge.yaml").read_text())
    assert listed["/**"]["lineloom_bridge"]["ros__parameters"] == defaults
