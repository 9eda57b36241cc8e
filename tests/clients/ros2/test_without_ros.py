"""`lineloom bridge`: on DDS and on Zenoh, with no ROS anywhere."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh
from lineloom.bridge.planar import Planar
from lineloom.bridge.settings import BridgeSettings
from lineloom.bridge.type_hashes import TYPE_HASHES
from lineloom.bridge.wire import run
from lineloom.bridge.wire_types import TYPES
from lineloom.bridge.zenoh import ZenohWire, attachment, key_of
from lineloom.cli.app import app
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

from tests.clients.fake_service import FakeService
from tests.clients.ros2.dds_graph import LOOPBACK, Drivers, Listener, own_domain, stamped, until
from tests.clients.ros2.mapped_site import MappedSite
from tests.service.fake_server import free_port

START = 1_700_000_000.0
JAZZY = get_typestore(Stores.ROS2_JAZZY)


def config(mode: str, role: str, port: int) -> Any:
    made = zenoh.Config()
    made.insert_json5("mode", f'"{mode}"')
    made.insert_json5(f"{role}/endpoints", f'["tcp/127.0.0.1:{port}"]')
    made.insert_json5("scouting/multicast/enabled", "false")
    made.insert_json5("timestamping/enabled", "true")
    return made


@pytest.fixture
def router() -> Iterator[int]:
    port = free_port()
    with zenoh.open(config("router", "listen", port)):
        yield port


def test_hashes_and_keys_are_ros_s() -> None:
    assert {name: JAZZY.hash_rihs01(name) for name in TYPE_HASHES} == TYPE_HASHES
    key = key_of(3, "/r1/scan", TYPES.LaserScan)
    begin = "3/r1/scan/sensor_msgs::msg::dds_::LaserScan_/"
    assert key == begin + JAZZY.hash_rihs01("sensor_msgs/msg/LaserScan")


def test_an_attachment_has_number_time_and_publisher() -> None:
    number, at = (7).to_bytes(8, "little"), (9).to_bytes(8, "little")
    expected = b"\x0fsequence_number" + number + b"\x10source_timestamp" + at
    assert bytes(attachment(7, 9, b"g" * 16)) == expected + b"\x0asource_gid\x10" + b"g" * 16


def test_a_robot_on_zenoh(fake: FakeService, loopback: str, tmp_path: Path, router: int) -> None:
    site = MappedSite(fake, "r")
    settings = BridgeSettings(
        url=loopback, site="s", robot="r", queue=str(tmp_path / "q.db"), max_rate=0.0,
        pose_period=0.02, map_period=0.1,
    )  # fmt: skip
    stopping = threading.Event()
    bridge_wire = ZenohWire(config("peer", "connect", router), domain=0)
    work = threading.Thread(target=run, args=(bridge_wire, settings, "r1", stopping.is_set))
    work.start()
    robot = ZenohWire(config("peer", "connect", router), domain=0)
    heard: dict[str, list[Any]] = {}
    try:
        scans = robot.advertise("/r1/scan", TYPES.LaserScan, latched=False)
        tf = robot.advertise("/r1/tf", TYPES.TFMessage, latched=False)
        fixed = robot.advertise("/r1/tf_static", TYPES.TFMessage, latched=True)
        fixed(TYPES.TFMessage(transforms=[transform(0.0, "base_link", "laser", Planar(0.3))]))
        for topic, kind, latched in (("/r1/tf", TYPES.TFMessage, False),
                                     ("/r1/map", TYPES.OccupancyGrid, True)):  # fmt: skip
            heard[topic] = []
            robot.listen(topic, kind, heard[topic].append, latched=latched, reliable=True)
        count = iter(range(10_000))

        def go() -> None:
            at = START + 0.1 * next(count)
            message = stamped(TYPES.LaserScan(), at, "laser")
            message.ranges, message.angle_increment = [1.0, 2.0, 3.0], 0.1
            message.range_min, message.range_max = 0.1, 30.0
            scans(message)
            tf(TYPES.TFMessage(transforms=[transform(at, "odom", "base_link", Planar(1.0))]))
            robot.spin_once(0.03)

        def edges() -> set[tuple[str, str]]:
            sent = [t for message in heard["/r1/tf"] for t in message.transforms]
            return {(t.header.frame_id, t.child_frame_id) for t in sent}

        until(lambda: ("map", "odom") in edges() and heard["/r1/map"], go)
        assert edges() <= {("map", "odom"), ("odom", "base_link")}
        assert site.mounts[0]["x"] == 0.3
        assert list(heard["/r1/map"][0].data) == [0, 100, -1, -1, -1, -1]
        replies = robot._session.liveliness().get("@ros2_lv/**")
        tokens = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        published = "/%r1%map/" + key_of(0, "", TYPES.OccupancyGrid).removeprefix("0//")
        assert any("/MP/" in token and published in token for token in tokens)
    finally:
        robot.close()
        stopping.set()
        work.join(60.0)
    assert not work.is_alive()


def transform(at: float, parent: str, child: str, pose: Planar) -> Any:
    message = stamped(TYPES.TransformStamped(), at, parent)
    message.child_frame_id = child
    message.transform.translation.x, message.transform.translation.y = pose.x, pose.y
    return message


def test_the_command_bridges_a_robot_on_dds_until_it_is_told_to_stop(
    fake: FakeService, loopback: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    domain = own_domain()
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    site = MappedSite(fake, "r")
    words = ["bridge", "r", "--dds", "--namespace", "r1", "--site", "s", "--url", loopback]
    command = [sys.executable, "-m", "lineloom.cli", *words, "--queue", str(tmp_path / "q.db")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        drivers, listener = Drivers(domain, "/r1", tf="/r1"), Listener(domain)
        listener.listen("/r1/tf", TYPES.TFMessage)
        drivers.mount()
        count = iter(range(10_000))

        def go() -> None:
            at = START + 0.2 * next(count)
            drivers.scan(at)
            drivers.odom_tf(at, Planar(1.0))
            drivers.wire.spin_once(0.05)

        until(lambda: listener.transforms("map", "/r1/tf"), go, listener.take)
        found = listener.transforms("map", "/r1/tf")
        assert {t.child_frame_id for t in found} == {"odom"}
        assert site.scans()
        process.send_signal(signal.SIGTERM)
        assert process.wait(60.0) == 0
    finally:
        process.kill()


def test_a_wire_must_be_named() -> None:
    done = CliRunner().invoke(app, ["bridge", "r"])
    assert done.exit_code == 2
    assert "--dds or --zenoh" in done.stderr
