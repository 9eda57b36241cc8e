"""The bridge without ROS: messages to scans, mounts, transforms, grids, lines."""

from __future__ import annotations

import io
import math
import zipfile
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from lineloom.bridge.lines import line_list
from lineloom.bridge.localisation import map_transform
from lineloom.bridge.occupancy import GridError, read_grid
from lineloom.bridge.odometry_track import OdometryTrack
from lineloom.bridge.planar import Planar, TiltedLidarError, mount, planar
from lineloom.bridge.robot_bridge import NoTransformError
from lineloom.bridge.scan_feed import ScanFeed, SentScan
from lineloom.bridge.settings import SettingError, read_settings
from lineloom.bridge.transform_tree import TransformTree
from lineloom.bridge.waiting_scans import Released, WaitingScans
from lineloom.scan_like import to_wire
from lineloom.wire import Line, MapAnswer, MapComponent, Robot
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
    assert feed.sent(0) == SentScan(5_500_000_000, Planar(1.0, 2.0, 0.5))
    assert feed.sent(1) is None


def test_too_many_scans_are_thinned_and_a_clock_that_jumps_back_is_no_end() -> None:
    feed = ScanFeed(Box(), max_rate=10.0)
    sent = [feed.admits(scan(100.0 + 0.025 * i)) for i in range(40)]
    assert 8 <= sum(sent) <= 11
    assert feed.admits(scan(3.0))


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
    feed.put(scan(7.25), T_odom_base)
    found = map_transform(robot(), feed, odometry=True)
    assert found is not None
    assert not found.to_base
    assert (found.component, found.seq, found.stamp) == ("c0", 0, 7_250_000_000)
    base = found.T @ T_odom_base
    assert (base.x, base.y, base.theta) == pytest.approx((10.0, 5.0, math.pi / 2))


def test_without_odometry_the_base_itself_is_placed() -> None:
    feed = ScanFeed(Box(), 10.0)
    feed.put(scan(), None)
    found = map_transform(robot(), feed, odometry=False)
    assert found is not None
    assert found.to_base
    assert (found.T.x, found.T.y) == (10.0, 5.0)


def test_with_odometry_configured_the_base_is_never_placed_in_the_map() -> None:
    feed = ScanFeed(Box(), 10.0)
    feed.put(scan(), None)
    assert map_transform(robot(), feed, odometry=True) is None


@pytest.mark.parametrize(
    "changes",
    [
        {"pose": None},
        {"state": "lost"},
        {"state": "silent"},
        {"latest_session": "yesterday"},
        {"latest_seq": 7},
        {"component": None},
    ],
)
def test_no_transform_is_better_than_a_wrong_one(changes: dict[str, Any]) -> None:
    feed = ScanFeed(Box(), 10.0)
    feed.put(scan(), Planar())
    assert map_transform(robot(**changes), feed, odometry=True) is None


def test_odometry_is_interpolated_and_never_extrapolated() -> None:
    track = OdometryTrack()
    assert track.at(5) is None
    track.put(10**9, Planar(1.0, 0.0, 3.0))
    track.put(2 * 10**9, Planar(2.0, 4.0, -3.0))
    half = track.at(1_500_000_000)
    assert half is not None
    assert (half.x, half.y) == (1.5, 2.0)
    assert abs(half.theta) == pytest.approx(math.pi)  # the short way round, not through 0
    assert track.at(2 * 10**9) == Planar(2.0, 4.0, -3.0)
    assert track.at(10**9 - 1) is None
    assert track.at(2 * 10**9 + 1) is None
    track.put(1_900_000_000, Planar(9.0, 9.0, 9.0))  # out of order
    assert track.at(2 * 10**9) == Planar(2.0, 4.0, -3.0)
    track.put(5 * 10**8, Planar(7.0, 7.0, 0.0))  # the bag begins anew
    assert track.at(5 * 10**8) == Planar(7.0, 7.0, 0.0)
    assert track.at(10**9) is None


def test_scans_wait_in_order_and_for_so_long() -> None:
    waiting = WaitingScans(timeout=0.5)
    known: dict[str, Planar] = {}
    for name, at in (("a", 0.0), ("b", 0.1), ("c", 0.3)):
        waiting.put(name, at)
    assert waiting.release(known.get, 0.4) == []
    known["b"] = Planar(1.0)
    assert waiting.release(known.get, 0.45) == []  # a is before it
    assert waiting.release(known.get, 0.5) == [Released("a", None), Released("b", Planar(1.0))]
    known["c"] = Planar(2.0)
    assert waiting.release(known.get, 0.55) == [Released("c", Planar(2.0))]


def test_a_way_through_the_tree_is_followed_at_one_time() -> None:
    tree = TransformTree()

    def put(parent: str, child: str, at: float, pose: Planar, *, static: bool = False) -> None:
        x, y, z, w = pose.quaternion
        message = SimpleNamespace(
            header=SimpleNamespace(
                frame_id=parent, stamp=SimpleNamespace(sec=int(at), nanosec=round(at % 1 * 1e9))
            ),
            child_frame_id=child,
            transform=SimpleNamespace(
                translation=SimpleNamespace(x=pose.x, y=pose.y, z=0.0),
                rotation=SimpleNamespace(x=x, y=y, z=z, w=w),
            ),
        )
        tree.put(message, static=static)

    put("base_footprint", "base_link", 0.0, Planar(0.1), static=True)
    put("base_link", "laser", 0.0, Planar(0.2, 0.0, math.pi / 2), static=True)
    put("odom", "base_footprint", 1.0, Planar(1.0, 0.0, 0.0))
    put("odom", "base_footprint", 2.0, Planar(2.0, 0.0, 0.0))
    found = tree.lookup("odom", "laser", 1_500_000_000)
    assert found.translation == pytest.approx((1.8, 0.0, 0.0))
    back = tree.lookup("laser", "odom", 1_500_000_000) @ found
    assert back.translation == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    for stamp in (999_999_999, 2_000_000_001):
        with pytest.raises(NoTransformError, match="from laser to odom"):
            tree.lookup("odom", "laser", stamp)
    with pytest.raises(NoTransformError):
        tree.lookup("odom", "camera", None)


def test_a_robot_may_be_called_7_and_a_rate_be_10() -> None:
    settings = read_settings({"robot": 7, "max_rate": 10, "frame_prefix": "r7/"})
    assert (settings.robot, settings.max_rate, settings.base) == ("7", 10.0, "r7/base_link")
    assert read_settings({"map_frame": "map_{component}"}).map_of("c-1") == "map_c-1"


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("robot", True, "robot: must be text"),
        ("robot", "", "robot: must not be empty"),
        ("publish_tf", "yes", "publish_tf: must be true or false"),
        ("pose_period", 0, "pose_period: must be more than 0"),
        ("transform_timeout", -1.0, "transform_timeout: must not be negative"),
        ("max_rate", "fast", "max_rate: must be a number"),
        ("odometry", "wheels", "odometry: 'wheels' is none of"),
    ],
)
def test_a_wrong_parameter_is_named(name: str, value: Any, said: str) -> None:
    with pytest.raises(SettingError, match=said):
        read_settings({name: value})


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
