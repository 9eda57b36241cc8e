"""Bags of every kind, written by rosbags, read as robots."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.io.rosbag import BagOptions, RosbagError, is_bag, read_bag, robot_name
from lineloom_core.io.static_transforms import TiltedLidarError

from tests.core.io.bags import (
    KINDS,
    ODOMETRY,
    SCAN,
    TRANSFORMS,
    Entry,
    Kind,
    Messages,
    write_bag,
)

START = 1_700_000_000.0


def fleet(kind: Kind) -> list[Entry]:
    """r1: an inverted lidar on a mast, Odometry at twice the scans' rate. r2: transforms only."""
    m = Messages(kind)
    first, second = "/r1/scan", "/r2/scan"
    entries: list[Entry] = [
        ("/tf_static", TRANSFORMS, START, m.transform(START, "r1/base_link", "r1/mast", 0.1, 0, 0)),
        (
            "/tf_static",
            TRANSFORMS,
            START,
            m.transform(START, "r1/mast", "r1/laser", 0.2, 0.05, math.pi / 2, math.pi),
        ),
    ]
    for i in range(4):
        t = START + 0.1 * i
        odom = m.odometry(t - 0.025, i, 2.0 * i, 0.1 * i)
        moving = m.transform(t, "r2/odom", "r2/base_link", 5.0 * i, 0.0, -0.1 * i)
        ranges = [1.0 + i, math.nan, math.inf, 31.0, 0.05]
        entries += [
            ("/r1/odom", ODOMETRY, t, odom),
            ("/tf", TRANSFORMS, t, moving),
            (first, SCAN, t, m.scan(t, "r1/laser", ranges)),
            (second, SCAN, t + 0.01, m.scan(t, "r2/laser", [2.0, 3.0])),
        ]
    return entries


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_bag_gives_the_same_robots(kind: Kind, tmp_path: Path) -> None:
    path = write_bag(tmp_path, kind, fleet(kind))
    assert is_bag(path)
    one, two = read_bag(path)
    assert [(r.topic, r.name, len(r.scans)) for r in (one, two)] == [
        ("/r1/scan", "r1", 4),
        ("/r2/scan", "r2", 4),
    ]
    scan = one.scans[2]
    assert scan.seq == 2
    assert scan.stamp == pytest.approx(START + 0.2, abs=1e-6)
    np.testing.assert_array_equal(scan.ranges, [3.0, np.nan, np.inf, np.inf, -np.inf])
    assert scan.angle_min == -1.0
    assert scan.angle_increment == pytest.approx(0.5, abs=1e-12)
    # The scan lies a quarter between two odometry messages.
    assert scan.odometry is not None
    assert scan.odometry.to_array() == pytest.approx([2.25, 4.5, 0.225], abs=1e-4)
    # From the transforms: the base's in the odom frame.
    assert two.scans[3].odometry is not None
    assert two.scans[3].odometry.to_array() == pytest.approx([15.0, 0.0, -0.3])
    assert one.mount is not None
    assert one.mount.inverted
    assert one.mount.T_base_laser.to_array() == pytest.approx([0.3, 0.05, math.pi / 2])
    assert two.mount is None


def test_a_bag_with_an_index_of_its_own_kind_is_read_from_its_chunks(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "ros1", fleet("ros1"))
    whole = read_bag(path)
    data = path.read_bytes()
    counts = data.count(b"count=\x04\x00\x00\x00")  # four messages in each index record
    assert counts >= 4
    # Whatever the entries are like: their size is not what the format says.
    path.write_bytes(data.replace(b"count=\x04\x00\x00\x00", b"count=\x03\x00\x00\x00"))
    read = read_bag(path)
    assert [(r.topic, len(r.scans)) for r in read] == [("/r1/scan", 4), ("/r2/scan", 4)]
    for ours, same in zip(read, whole, strict=True):
        assert [s.stamp for s in ours.scans] == [s.stamp for s in same.scans]
        assert [s.odometry for s in ours.scans] == [s.odometry for s in same.scans]


def test_topics_and_odometry_can_be_chosen(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "mcap", fleet("mcap"))
    (two,) = read_bag(path, BagOptions(topics=("/r2/scan",), odometry_topic="/r1/odom"))
    assert two.name == "r2"
    assert two.scans[0].odometry is not None
    assert two.scans[0].odometry.x == pytest.approx(0.25, abs=1e-4)
    with pytest.raises(RosbagError, match=r"no laser scans on /r3/scan; they are on: /r1/scan"):
        read_bag(path, BagOptions(topics=("/r3/scan",)))


def test_a_bag_without_scans_says_what_it_has(tmp_path: Path) -> None:
    m = Messages("ros1")
    path = write_bag(tmp_path, "ros1", [("/odom", ODOMETRY, START, m.odometry(START, 0, 0, 0))])
    with pytest.raises(RosbagError, match=r"it has: /odom \(nav_msgs/msg/Odometry\)"):
        read_bag(path)


def test_broken_scans_are_left_out_and_told(tmp_path: Path) -> None:
    m = Messages("sqlite")
    good = m.scan(START, "laser", [1.0, 2.0, 3.0])
    bad = m.scan(START + 0.1, "laser", [1.0, 2.0], angle_increment=0.0, angle_max=7.0)
    late = m.scan(START + 0.2, "laser", [1.0, 2.0, 3.0])
    entries: list[Entry] = [
        ("/scan", SCAN, START + 0.1 * i, message) for i, message in enumerate((good, bad, late))
    ]
    (robot,) = read_bag(write_bag(tmp_path, "sqlite", entries))
    assert [scan.seq for scan in robot.scans] == [0, 1]
    assert robot.refused == ("/scan, message 1: angle_increment: must not be 0",)
    assert robot.name == ""


def test_a_lidar_that_is_not_level_is_refused(tmp_path: Path) -> None:
    m = Messages("mcap")
    entries: list[Entry] = [
        (
            "/tf_static",
            TRANSFORMS,
            START,
            m.transform(START, "base_link", "laser", 0, 0, 0, math.radians(30.0)),
        ),
        ("/scan", SCAN, START, m.scan(START, "laser", [1.0, 2.0])),
    ]
    with pytest.raises(TiltedLidarError, match="tilted by 30 degrees"):
        read_bag(write_bag(tmp_path, "mcap", entries))


@pytest.mark.parametrize("name", ["x.bag", "x.mcap", "x.db3"])
def test_no_bag_is_told(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"not a bag")
    with pytest.raises(RosbagError, match="not a bag that can be read"):
        read_bag(path)


def test_names_of_robots() -> None:
    assert [robot_name(t) for t in ("/scan", "/a/scan", "/a/b/base_scan", "/a/front")] == [
        *("", "a", "a-b", "a-front")
    ]
