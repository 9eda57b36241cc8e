"""The bridge without ROS: messages to scans, mounts, transforms, grids, lines."""

from __future__ import annotations

import io
import math
import zipfile
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from lineloom.scan_like import to_wire
from lineloom.wire import Line, MapAnswer, MapComponent, Robot
from lineloom_bridge.lines import line_list
from lineloom_bridge.localisation import map_transform
from lineloom_bridge.occupancy import GridError, read_grid
from lineloom_bridge.planar import Planar, TiltedLidarError, mount, planar
from lineloom_bridge.scan_feed import ScanFeed
from lineloom_core.fusion.occupancy import OccupancyGrid
from lineloom_core.geometry import Pose
from lineloom_core.io.nav2 import write_map


def scan(stamp: float = 5.5, ranges: tuple[float, ...] = (1.0, math.nan, math.inf)) -> Any:
    header = SimpleNamespace(
        stamp=SimpleNamespace(sec=int(stamp), nanosec=round(stamp % 1 * 1e9)), frame_id="laser"
    )
    return SimpleNamespace(
        header=header,
        angle_min=-1.0,
        angle_max=1.0,
        angle_increment=1.0,
        time_increment=0.0,
        scan_time=0.1,
        range_min=0.1,
        range_max=30.0,
        ranges=list(ranges),
    )


class Box:
    """An outbox that keeps what it is given."""

    session = "s-1"

    def __init__(self) -> None:
        self.scans: list[dict[str, Any]] = []

    def put(self, scan: dict[str, Any]) -> int:
        self.scans.append(scan)
        return len(self.scans) - 1


def quaternion(yaw: float, roll: float = 0.0) -> Any:
    c, s, a, b = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(roll / 2), math.sin(roll / 2)
    return SimpleNamespace(x=c * b, y=s * b, z=s * a, w=c * a)


def test_a_message_becomes_the_contracts_scan() -> None:
    box = Box()
    feed = ScanFeed(box, max_rate=10.0)
    assert feed.put(scan(), Planar(1.0, 2.0, 0.5)) == 0
    wire = to_wire(box.scans[0], seq=0)
    assert wire.stamp == 5.5
    assert wire.odometry is not None
    assert (wire.odometry.x, wire.odometry.theta) == (1.0, 0.5)
    values = np.asarray(wire.ranges, dtype=float)
    np.testing.assert_array_equal(values, [1.0, np.nan, np.inf])
    assert feed.odometry_at(0) == Planar(1.0, 2.0, 0.5)
    assert feed.odometry_at(1) is None


def test_too_many_scans_are_thinned_and_a_clock_that_jumps_back_is_no_end() -> None:
    box = Box()
    feed = ScanFeed(box, max_rate=10.0)
    sent = [feed.put(scan(100.0 + 0.025 * i), None) is not None for i in range(40)]
    assert 8 <= sum(sent) <= 11
    assert feed.put(scan(3.0), None) is not None


def test_poses_compose_as_the_cores_do() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        a, b = (rng.uniform(-3.0, 3.0, 3).tolist() for _ in range(2))
        ours = Planar(*a) @ Planar(*b)
        theirs = Pose(*a) @ Pose(*b)
        assert (ours.x, ours.y) == pytest.approx((theirs.x, theirs.y))
        assert math.cos(ours.theta - theirs.theta) == pytest.approx(1.0)
        back = Planar(*a).inverse() @ Planar(*a)
        assert (back.x, back.y, back.theta) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
        x, y, z, w = Planar(*a).quaternion
        at = SimpleNamespace(x=0.0, y=0.0)
        turn = planar(at, SimpleNamespace(x=x, y=y, z=z, w=w)).theta
        assert math.cos(turn - a[2]) == pytest.approx(1.0)


def test_mounts_upright_upside_down_and_tilted() -> None:
    at = SimpleNamespace(x=0.3, y=-0.1, z=0.5)
    upright = mount(at, quaternion(0.7))
    assert not upright.inverted
    assert upright.T_base_laser.theta == pytest.approx(0.7)
    hung = mount(at, quaternion(0.7, math.pi))
    assert hung.inverted
    assert hung.T_base_laser == Planar(0.3, -0.1, pytest.approx(0.7))  # type: ignore[arg-type]
    with pytest.raises(TiltedLidarError, match="45 degrees"):
        mount(at, quaternion(0.7, math.radians(45.0)))


def robot(**changes: Any) -> Robot:
    pose = {"x": 10.0, "y": 5.0, "theta": math.pi / 2, "covariance": None}
    fields: dict[str, Any] = {
        "robot": "r",
        "site": "s",
        "component": "c0",
        "pose": pose,
        "state": "tracking",
        "scans": {"accepted": 1, "processed": 1, "pending": 0, "skipped": 0},
        "latest_session": "s-1",
        "latest_seq": 0,
        "health": [],
    }
    return Robot.model_validate(fields | changes)


def test_map_to_odom_puts_the_base_where_the_map_has_it() -> None:
    feed = ScanFeed(Box(), 10.0)
    T_odom_base = Planar(3.0, 1.0, 0.2)
    feed.put(scan(), T_odom_base)
    found = map_transform(robot(), feed)
    assert found is not None
    assert not found.to_base
    assert found.component == "c0"
    base = found.T @ T_odom_base
    assert (base.x, base.y, base.theta) == pytest.approx((10.0, 5.0, math.pi / 2))


def test_without_odometry_the_base_itself_is_placed() -> None:
    feed = ScanFeed(Box(), 10.0)
    feed.put(scan(), None)
    found = map_transform(robot(), feed)
    assert found is not None
    assert found.to_base
    assert (found.T.x, found.T.y) == (10.0, 5.0)


@pytest.mark.parametrize(
    "changes",
    [{"pose": None}, {"state": "lost"}, {"latest_session": "yesterday"}, {"component": None}],
)
def test_no_transform_is_better_than_a_wrong_one(changes: dict[str, Any]) -> None:
    feed = ScanFeed(Box(), 10.0)
    feed.put(scan(), Planar())
    assert map_transform(robot(**changes), feed) is None


def test_the_services_grid_is_the_messages() -> None:
    rng = np.random.default_rng(0)
    cells = rng.choice(np.array([-1, 0, 100], dtype=np.int8), (7, 5))
    grid = read_grid(write_map(OccupancyGrid(cells, -1.25, 2.5, 0.05)))
    assert (grid.width, grid.height, grid.resolution) == (5, 7, 0.05)
    assert (grid.x, grid.y) == (-1.25, 2.5)
    assert list(grid.data) == cells.reshape(-1).tolist()


def zipped(**files: bytes) -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        for name, content in files.items():
            archive.writestr(name.replace("_", "."), content)
    return target.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        b"no zip",
        zipped(map_yaml=b"resolution: 1\norigin: [0, 0, 0]\n"),
        zipped(map_yaml=b"", map_pgm=b"P5\n2 2\n255\n1234"),
        zipped(map_yaml=b"resolution: 1\norigin: [0, 0, 0]\n", map_pgm=b"P5\n2 2\n255\n123"),
    ],
)
def test_what_is_no_grid_is_told(content: bytes) -> None:
    with pytest.raises(GridError):
        read_grid(content)


def test_lines_of_one_component_in_the_robots_colours() -> None:
    def line(component: str, x: float, robots: list[str]) -> Line:
        return Line(
            id=f"l{x}", component=component, x1=x, y1=0.0, x2=x + 1, y2=0.0, sigma=0.01,
            support=1, robots=robots, first_seen=0.0, last_seen=0.0,
        )  # fmt: skip

    lines = [line("c0", 0.0, ["a"]), line("c1", 5.0, ["b"]), line("c0", 2.0, ["a", "b"])]
    components = [MapComponent(id="c0", robots=["a", "b"])]
    found = line_list(MapAnswer(site="s", version=1, components=components, lines=lines), "c0")
    assert found.points == ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0))
    assert len(found.colours) == 4
    assert found.colours[0] == found.colours[1] != found.colours[2]
