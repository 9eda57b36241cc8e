"""The node on DDS, against a stand-in for the service: what a ROS graph sees, byte by byte."""

from __future__ import annotations

import importlib
import json
import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from lineloom.bridge.planar import Planar
from lineloom.bridge.wire_types import TYPES

from tests.clients.fake_service import FakeService
from tests.clients.ros2 import rclpy_on_dds
from tests.clients.ros2.dds_graph import (
    LOOPBACK,
    Drivers,
    Listener,
    for_a_while,
    own_domain,
    until,
)
from tests.clients.ros2.mapped_site import MappedSite

QUARTER = pytest.approx(math.pi / 2)
START = 1_700_000_000.0
MOVED = Planar(10.0, 5.0, 1.0)
"""T_map_odom, as the stand-in for the service has it."""


class Graph:
    """A node, and who listens to it. Stamps count from START."""

    def __init__(self, site: MappedSite, url: str, folder: Path) -> None:
        self.site, self._url, self._folder = site, url, folder
        self.domain = own_domain()
        self.listener = Listener(self.domain)
        self.nodes: list[Any] = []
        self._stack = ExitStack()

    def node(
        self, namespace: str = "", remaps: dict[str, str] | None = None, **parameters: Any
    ) -> Any:
        """Start a node."""
        name = parameters.get("robot", "r")
        given = {
            "url": self._url,
            "site": "s",
            "robot": "r",
            "queue": str(self._folder / f"{name}.db"),
            "pose_period": 0.02,
            "map_period": 0.1,
            "transform_timeout": 0.3,
            "max_rate": 0.0,
        } | parameters
        self._stack.enter_context(rclpy_on_dds.installed(self.domain, namespace, remaps, **given))
        node = importlib.import_module("lineloom_bridge.node").Bridge()
        self.nodes.append(node)
        return node

    @property
    def turns(self) -> list[Callable[[], Any]]:
        """Everybody's crank."""
        return [*(node.turn for node in self.nodes), self.listener.take]

    def until(self, condition: Callable[[], Any]) -> None:
        """Go on until something holds."""
        until(condition, *self.turns)

    def wait(self, seconds: float) -> None:
        """Go on for so long."""
        for_a_while(seconds, *self.turns)

    def levels(self) -> list[tuple[int, str]]:
        """Return what /diagnostics said, without repetitions."""
        said = [
            (m.status[0].level, m.status[0].message) for m in self.listener.heard["/diagnostics"]
        ]
        return [pair for i, pair in enumerate(said) if i == 0 or pair != said[i - 1]]

    def close(self) -> None:
        """Stop everybody."""
        for node in self.nodes:
            node.close()
            node.wire.close()
        self._stack.close()


@pytest.fixture
def graph(
    fake: FakeService, loopback: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Graph]:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    graph = Graph(MappedSite(fake, "r"), loopback, tmp_path)
    graph.listener.listen("/tf", TYPES.TFMessage)
    graph.listener.listen("/diagnostics", TYPES.DiagnosticArray)
    yield graph
    graph.close()


def drive(i: int) -> Planar:
    return Planar(0.1 * i, 0.02 * i, 0.01 * i)


def ready(graph: Graph, drivers: Drivers, node: Any) -> None:
    """Have the lidar's mount known; scans that came before are lost, as they should be."""
    drivers.mount()
    count = iter(range(10_000))

    def offer() -> None:
        drivers.scan(START - 100.0 + 0.1 * next(count))

    until(lambda: node.bridge.link.mounted, *graph.turns, offer)
    node.bridge.pause(True)  # whatever is still under way
    graph.wait(0.2)
    node.bridge.pause(False)


def test_scans_in_and_everything_out_as_ros_reads_it(graph: Graph) -> None:
    for topic, kind in (("/map", TYPES.OccupancyGrid), ("/map_metadata", TYPES.MapMetaData),
                        ("/map_lines", TYPES.Marker), ("/component", TYPES.String)):  # fmt: skip
        graph.listener.listen(topic, kind, latched=True)
    graph.listener.listen("/pose", TYPES.PoseWithCovarianceStamped)
    node, drivers = graph.node(), Drivers(graph.domain)
    ready(graph, drivers, node)
    for i in range(10):
        drivers.scan(START + i, [1.0, math.inf, 2.0])
        drivers.odom_tf(START + i, drive(i))
        graph.wait(0.06)
    graph.until(lambda: len(graph.site.scans()) >= 10 and graph.listener.heard["/map_lines"])
    assert graph.site.mounts[0] == {"x": 0.3, "y": 0.0, "theta": QUARTER, "inverted": False}
    assert [scan["stamp"] for scan in graph.site.scans()[-10:]] == [START + i for i in range(10)]
    graph.until(lambda: graph.listener.transforms("map")[-1].header.stamp.sec == START + 10)
    transforms = graph.listener.transforms("map")
    assert {t.child_frame_id for t in transforms} == {"odom"}
    stamps = [t.header.stamp.sec + 1e-9 * t.header.stamp.nanosec for t in transforms]
    assert stamps == sorted(set(stamps))  # each once: TF warns of repetitions
    assert all(START + 1.0 <= s <= START + 10.0 for s in stamps)  # a scan's time, and 1 s
    for t in transforms:
        assert t.transform.translation.x == pytest.approx(MOVED.x)
        assert t.transform.translation.y == pytest.approx(MOVED.y)
        assert 2.0 * math.atan2(t.transform.rotation.z, t.transform.rotation.w) == pytest.approx(
            1.0
        )
    pose = graph.listener.heard["/pose"][-1]
    assert pose.header.stamp.sec == START + 9
    expected = MOVED @ drive(9)
    assert pose.pose.pose.position.x == pytest.approx(expected.x)
    assert (pose.pose.covariance[0], pose.pose.covariance[7]) == (0.01, 0.02)
    assert pose.pose.covariance[35] == 0.003
    grid = graph.listener.heard["/map"][0]
    assert (grid.info.width, grid.info.height) == (3, 2)
    assert grid.info.resolution == pytest.approx(0.05)
    assert (grid.info.origin.position.x, grid.info.origin.position.y) == (-1.0, -2.0)
    assert grid.data.tolist() == [0, 100, -1, -1, -1, -1]
    assert graph.listener.heard["/map_metadata"][0].width == 3
    marker = graph.listener.heard["/map_lines"][0]
    assert (marker.type, marker.header.frame_id) == (5, "map")
    assert [(p.x, p.y) for p in marker.points] == [(0.0, 0.0), (1.0, 0.5)]
    assert len(marker.colors) == 2
    assert json.loads(graph.listener.heard["/component"][0].data)["component"] == "c0"
    assert (0, "localised") in graph.levels()


@pytest.mark.parametrize("odometry", ["tf", "topic"])
def test_a_transform_that_comes_late_is_waited_for(graph: Graph, odometry: str) -> None:
    node, drivers = graph.node(odometry=odometry), Drivers(graph.domain)
    say = drivers.odom if odometry == "topic" else drivers.odom_tf
    ready(graph, drivers, node)
    say(START - 0.05, drive(0))
    for i in range(20):
        drivers.scan(START + 0.1 * i)
        graph.wait(0.02)
        say(START + 0.1 * i + 0.05, drive(i + 1))
    graph.until(lambda: len(graph.site.scans()) >= 20)
    graph.until(lambda: len(graph.listener.transforms("map")) > 1)
    scans = graph.site.scans()[-20:]
    # Half way between two messages.
    assert [s["odometry"]["x"] for s in scans] == pytest.approx([0.1 * i + 0.05 for i in range(20)])
    assert {t.child_frame_id for t in graph.listener.transforms("map")} == {"odom"}
    assert node.bridge.seen.dropped == 0


def test_a_transform_that_never_comes_costs_the_scan_and_never_the_tree(graph: Graph) -> None:
    node, drivers = graph.node(), Drivers(graph.domain)
    ready(graph, drivers, node)
    before = len(graph.site.scans())
    for i in range(10):
        drivers.scan(START + 0.1 * i)
        graph.wait(0.05)
    graph.until(lambda: node.bridge.seen.dropped == 10)
    assert any("scan dropped: TF does not have odom -> base_link" in t for t in node.logger.said)
    drivers.odom_tf(START + 10.0, drive(0))
    drivers.scan(START + 10.0)
    graph.until(lambda: graph.listener.transforms("map"))
    assert len(graph.site.scans()) == before + 1
    assert {t.child_frame_id for t in graph.listener.transforms("map")} == {"odom"}
    assert any(level == 1 and "dropped" in text for level, text in graph.levels())


def test_odometry_that_jumps_and_time_that_is_set_back(graph: Graph) -> None:
    node, drivers = graph.node(), Drivers(graph.domain)
    ready(graph, drivers, node)

    def arrived(stamp: float) -> bool:
        stamps = [t.header.stamp for t in graph.listener.transforms("map")]
        return any(s.sec + 1e-9 * s.nanosec == stamp for s in stamps)

    for at, pose in ((50.0, drive(3)), (50.5, Planar(-40.0, 9.0, 2.0)), (0.0, drive(1))):
        drivers.odom_tf(START + at, pose)
        drivers.scan(START + at)
        graph.until(partial(arrived, START + at + 1.0))
    for t in graph.listener.transforms("map"):  # the same map -> odom, whatever odometry did
        assert t.transform.translation.x == pytest.approx(MOVED.x)
        assert t.transform.translation.y == pytest.approx(MOVED.y)
    assert node.bridge.seen.dropped == 0


@pytest.mark.parametrize("why", ["lost", "silent", "away", "no scans"])
def test_no_stale_pose_with_a_fresh_stamp(graph: Graph, why: str) -> None:
    node, drivers = graph.node(silent_after=0.5), Drivers(graph.domain)
    ready(graph, drivers, node)
    clock = iter(range(10_000))

    def go() -> None:
        i = next(clock)
        drivers.odom_tf(START + 0.1 * i, drive(i))
        drivers.scan(START + 0.1 * i)
        graph.wait(0.03)

    until(lambda: len(graph.listener.transforms("map")) > 3, go)
    graph.site.away = why == "away"
    graph.site.state["r"] = why if why in ("lost", "silent") else "tracking"
    graph.wait(0.3)
    seen = len(graph.listener.transforms("map"))
    for _ in range(25):
        graph.wait(0.03) if why == "no scans" else go()
    assert len(graph.listener.transforms("map")) == seen
    expected = {
        "lost": "the robot is lost",
        "silent": "the robot is silent",
        "away": "no pose from the service",
        "no scans": "no scan for",
    }
    until(lambda: any(level >= 2 and expected[why] in text for level, text in graph.levels()),
          *(graph.turns if why == "no scans" else [go]))  # fmt: skip
    graph.site.away, graph.site.state["r"] = False, "tracking"
    until(lambda: len(graph.listener.transforms("map")) > seen, go)
    until(lambda: graph.levels()[-1] == (0, "localised"), go)


def test_without_odometry_the_base_is_where_it_was_and_not_ahead(graph: Graph) -> None:
    node, drivers = graph.node(odometry="none"), Drivers(graph.domain)
    ready(graph, drivers, node)
    drivers.scan(START + 3.0)
    found = graph.listener.transforms
    graph.until(lambda: found("map") and found("map")[-1].header.stamp.sec == START + 3)
    assert {t.child_frame_id for t in found("map")} == {"base_link"}


def test_a_lidar_that_tf_does_not_know_sends_nothing(graph: Graph) -> None:
    node, drivers = graph.node(), Drivers(graph.domain)
    until(lambda: any(level == 2 and "no scans are sent" in text for level, text in graph.levels()),
          *graph.turns, lambda: drivers.scan(time.time()))  # fmt: skip
    assert any("no scans yet: no transform from laser to base_link" in t for t in node.logger.said)
    assert graph.site.mounts == []
    assert graph.site.scans() == []


def test_two_robots_on_one_graph_and_what_a_merge_does(
    fake: FakeService, loopback: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    site = MappedSite(fake, "7", "b")
    site.moved = {"c0": MOVED, "c1": Planar(-3.0, 0.0, 0.0)}
    site.component["b"] = "c1"
    graph = Graph(site, loopback, tmp_path)
    own_tf = {"/tf": "tf", "/tf_static": "tf_static"}
    shared: dict[str, Any] = {"frame_prefix": "b/", "map_frame": "map_{component}"}
    nodes = {
        "7": graph.node("/r7", own_tf, robot=7),  # a number, as the command line gives it
        "b": graph.node("/rb", robot="b", **shared),
    }
    drivers = {
        "7": Drivers(graph.domain, "/r7", tf="/r7"),
        "b": Drivers(graph.domain, "/rb", prefix="b/"),
    }
    for topic in ("/r7/tf", "/tf"):
        graph.listener.listen(topic, TYPES.TFMessage)
    for name in ("/r7", "/rb"):
        graph.listener.listen(f"{name}/map", TYPES.OccupancyGrid, latched=True)
        graph.listener.listen(f"{name}/component", TYPES.String, latched=True)
    try:
        for name, node in nodes.items():
            ready(graph, drivers[name], node)
        count = iter(range(10_000))

        def go() -> None:
            at = START + 0.1 * next(count)
            for each in drivers.values():
                each.odom_tf(at, drive(1))
                each.scan(at)
            graph.wait(0.03)

        heard = graph.listener.heard
        until(lambda: heard["/r7/map"] and heard["/rb/map"], go)
        until(lambda: graph.listener.transforms("map_c1"), go)
        assert {t.child_frame_id for t in graph.listener.transforms("map", "/r7/tf")} == {"odom"}
        assert {t.child_frame_id for t in graph.listener.transforms("map_c1")} == {"b/odom"}
        assert not graph.listener.transforms("map")  # the one robot's tree is not the other's
        assert heard["/r7/map"][-1].header.frame_id == "map"
        assert heard["/rb/map"][-1].header.frame_id == "map_c1"
        assert site.scans("7")
        assert site.scans("b")

        site.merged_into, site.component["b"] = {"c1": "c0"}, "c0"  # they met; the same version
        until(lambda: len(heard["/rb/component"]) > 1, go)
        assert json.loads(heard["/rb/component"][-1].data) == {
            "robot": "b",
            "component": "c0",
            "before": "c1",
            "merged": True,
            "frame": "map_c0",
        }
        until(lambda: heard["/rb/map"][-1].header.frame_id == "map_c0", go)
        assert heard["/rb/map"][-1].info.width == 3
        until(lambda: graph.listener.transforms("map_c0"), go)
        assert len(heard["/r7/component"]) == 1
    finally:
        graph.close()
