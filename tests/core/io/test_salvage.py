"""Bags that were cut, lost their index or their metadata: what is there is read, and told."""

from __future__ import annotations

import json
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.io.rosbag import BagOptions, RosbagError, is_bag, read_bag

from tests.core.io.bags import KINDS, SCAN, TRANSFORMS, Entry, Kind, Messages, write_bag

START = 1_700_000_000.0
SCANS = 60


def _entries(kind: Kind) -> list[Entry]:
    m, rng = Messages(kind), np.random.default_rng(4)
    return [
        ("/scan", SCAN, START + 0.1 * i, m.scan(START + 0.1 * i, "laser", rng.uniform(1, 9, 300)))
        for i in range(SCANS)
    ]


@pytest.fixture(scope="module", params=["ros1", "lone mcap", "sqlite"])
def bag(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of each kind."""
    kind: Kind = request.param
    path = write_bag(tmp_path_factory.mktemp("bags"), kind, _entries(kind))
    return next(path.glob("*.db3")) if path.is_dir() else path


@pytest.mark.parametrize("share", [0.35, 0.7, 0.95])
def test_a_cut_file_gives_what_it_has(bag: Path, share: float, tmp_path: Path) -> None:
    data = bag.read_bytes()
    cut = tmp_path / bag.name
    cut.write_bytes(data[: int(share * len(data))])
    (whole,) = read_bag(bag)
    (robot,) = read_bag(cut)
    # A bag of SQLite ends with pages that its rows need.
    assert (0.05 if bag.suffix == ".db3" else 0.6) * share * SCANS < len(robot.scans) < SCANS
    stamps = {scan.stamp: scan for scan in whole.scans}
    for scan in robot.scans:
        np.testing.assert_array_equal(scan.ranges, stamps[scan.stamp].ranges)
    assert "cut" in robot.refused[0]
    assert f"{len(robot.scans)} scans could be read" in robot.refused[0]


def test_a_bag_without_its_index_is_read_whole(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "ros1", _entries("ros1"))
    data = bytearray(path.read_bytes())
    at = data.find(b"index_pos=") + 10
    data[at : at + 8] = bytes(8)
    path.write_bytes(data)
    (robot,) = read_bag(path)
    assert len(robot.scans) == SCANS
    assert "without its index" in robot.refused[0]


@pytest.mark.parametrize("kind", ["sqlite", "mcap"])
def test_a_folder_without_metadata_is_read(kind: Kind, tmp_path: Path) -> None:
    folder = write_bag(tmp_path, kind, _entries(kind))
    (folder / "metadata.yaml").unlink()
    assert is_bag(folder)
    assert len(read_bag(folder)[0].scans) == SCANS
    second = folder / ("b" + next(f.suffix for f in folder.iterdir()))
    shutil.copy(next(folder.iterdir()), second)
    assert len(read_bag(folder)[0].scans) == 2 * SCANS


@pytest.mark.parametrize("name", ["e.bag", "e.mcap", "e.db3"])
@pytest.mark.parametrize("content", [b"", b"not a bag" * 99])
def test_what_is_no_bag_is_refused_in_words(name: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(RosbagError, match="not a bag that can be read"):
        read_bag(path)


def _record(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def _string(text: str) -> bytes:
    return struct.pack("<L", len(text)) + text.encode()


def test_json_after_foxglove_is_read(tmp_path: Path) -> None:
    schema = struct.pack("<H", 1) + _string("foxglove.LaserScan") + _string("jsonschema")
    channel = struct.pack("<HH", 7, 1) + _string("/scan") + _string("json") + struct.pack("<L", 0)
    records = _record(3, schema + struct.pack("<L", 2) + b"{}") + _record(4, channel)
    for number in range(3):
        message = {
            "timestamp": {"sec": 5 + number, "nsec": 500_000_000},
            "frame_id": "laser",
            "start_angle": -1.0,
            "end_angle": 1.0,
            "ranges": [1.0, 2.0, None, "Infinity", 3.0],
        }
        head = struct.pack("<HLQQ", 7, number, number, number)
        records += _record(5, head + json.dumps(message).encode())
    path = tmp_path / "f.mcap"
    magic = b"\x89MCAP0\r\n"
    path.write_bytes(magic + _record(1, _string("") + _string("test")) + records)
    (robot,) = read_bag(path)
    assert [scan.stamp for scan in robot.scans] == [5.5, 6.5, 7.5]
    assert robot.scans[0].angle_increment == 0.5
    np.testing.assert_array_equal(robot.scans[0].ranges, [1.0, 2.0, np.nan, np.inf, 3.0])


def test_a_base_frame_that_is_asked_for_has_to_be_there(tmp_path: Path) -> None:
    m = Messages("lone mcap")
    static = m.transform(START, "base_footprint", "laser", 0.2, 0.0, 0.0)
    entries = [("/tf_static", TRANSFORMS, START, static), *_entries("lone mcap")]
    path = write_bag(tmp_path, "lone mcap", entries)
    with pytest.raises(RosbagError, match="'base_lnk'; frames: base_footprint, laser"):
        read_bag(path, BagOptions(base_frame="base_lnk"))
    assert read_bag(path)[0].mount is None
    assert read_bag(path, BagOptions(base_frame="base_footprint"))[0].mount is not None


@pytest.mark.parametrize("kind", KINDS)
def test_robots_whose_transforms_have_no_prefix_are_told(kind: Kind, tmp_path: Path) -> None:
    m, entries = Messages(kind), list[Entry]()
    for i in range(6):
        t = START + 0.1 * i
        entries += [
            ("/tf", TRANSFORMS, t, m.transform(t, "odom", "base_link", 5.0 * (i % 2), 0.0, 0.0)),
            ("/r1/scan", SCAN, t, m.scan(t, "laser", [2.0, 3.0])),
            ("/r2/scan", SCAN, t + 0.01, m.scan(t, "laser", [2.0, 3.0])),
        ]
    for robot in read_bag(write_bag(tmp_path, kind, entries)):
        assert "have no prefix for each robot" in robot.refused[0]
        assert all(scan.odometry is None for scan in robot.scans)
