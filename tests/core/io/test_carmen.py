"""CARMEN logs: made-up lines for every rule, and the real logs against their references."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.io.carmen import FlaserSweep, read_carmen, read_log
from lineloom_core.io.log_scan import LogError

DATA = Path(__file__).parents[4] / "shared" / "data"


def flaser(ranges: list[float], laser: str = "1 2 0.5", robot: str = "0.9 2 0.5") -> str:
    values = " ".join(str(value) for value in ranges)
    return f"FLASER {len(ranges)} {values} {laser} {robot} 12.5 host 0.25\n"


def robotlaser(ranges: list[float], remissions: int = 0, range_max: float = 50.0) -> str:
    values = " ".join(str(value) for value in ranges)
    intensities = "".join(f" {i}" for i in range(remissions))
    return (
        f"ROBOTLASER1 0 -1.5 3.0 0.01 {range_max} 0.1 0 {len(ranges)} {values} "
        f"{remissions}{intensities} 1.5 0 0 1 0 0 0 0 0 0 0 77.25 host 3.5\n"
    )


def write(folder: Path, *lines: str) -> Path:
    path = folder / "made-up.log"
    path.write_text("".join(lines), encoding="ascii")
    return path


@pytest.mark.parametrize(
    ("beams", "first_deg", "last_deg"),
    [(180, -90.0, 89.0), (181, -90.0, 90.0), (360, -90.0, 89.5), (361, -90.0, 90.0)],
)
def test_flaser_beams_cover_the_half_turn_of_a_sick(
    tmp_path: Path, beams: int, first_deg: float, last_deg: float
) -> None:
    (scan,) = read_carmen(write(tmp_path, flaser([2.0] * beams)))
    assert len(scan) == beams
    assert math.degrees(scan.angles[0]) == pytest.approx(first_deg)
    assert math.degrees(scan.angles[-1]) == pytest.approx(last_deg)


def test_zero_is_unknown_and_the_maximum_is_no_return(tmp_path: Path) -> None:
    ranges = [2.0] * 181
    ranges[3], ranges[4], ranges[5] = 0.0, 81.91, 81.89
    (scan,) = read_carmen(write(tmp_path, flaser(ranges)))
    assert np.isnan(scan.ranges[3])
    assert scan.ranges[4] == np.inf
    assert scan.ranges[5] == 81.89
    assert np.isfinite(scan.ranges).sum() == 179


def test_odometry_is_the_robots_pose_and_not_the_lasers(tmp_path: Path) -> None:
    path = write(
        tmp_path, flaser([2.0] * 181, laser="2 3 1.57079632679", robot="2 2.5 1.57079632679")
    )
    (record,) = read_log(path)
    assert record.scan.odometry == Pose(2.0, 2.5, 1.57079632679)
    assert record.line == 1


def test_robotlaser_speaks_for_itself(tmp_path: Path) -> None:
    (record,) = read_log(write(tmp_path, robotlaser([1.0, 60.0, 0.0], remissions=2)))
    scan = record.scan
    assert (scan.angle_min, scan.angle_increment, scan.range_max) == (-1.5, 0.01, 50.0)
    assert scan.stamp == 77.25
    assert scan.ranges[1] == np.inf
    assert np.isnan(scan.ranges[2])
    assert scan.odometry == Pose(1.0, 0.0, 0.0)


def test_seq_counts_scans_and_other_messages_are_passed_over(tmp_path: Path) -> None:
    lines = ["# a comment\n", "PARAM robot_length 0.47 1 h 1\n", "\n", flaser([2.0] * 181)]
    lines += ["ODOM 0 0 0 0 0 0 1 h 1\n", "RLASER 1 2 3\n", flaser([3.0] * 181)]
    scans = list(read_carmen(write(tmp_path, *lines), session="run-1"))
    assert [(scan.session, scan.seq) for scan in scans] == [("run-1", 0), ("run-1", 1)]


def test_a_scan_logged_as_both_messages_is_read_once(tmp_path: Path) -> None:
    pair = [flaser([2.0] * 181), robotlaser([2.0, 2.0])]
    scans = list(read_carmen(write(tmp_path, *pair, *pair)))
    assert [len(scan) for scan in scans] == [181, 181]


def test_an_unknown_beam_count_needs_to_be_told_its_sweep(tmp_path: Path) -> None:
    path = write(tmp_path, flaser([2.0] * 5))
    with pytest.raises(LogError, match=r"made-up\.log:1: FLASER: 5 beams.*FlaserSweep"):
        list(read_carmen(path))
    (scan,) = read_carmen(path, flaser=FlaserSweep(-0.2, 0.1, range_max=1.5))
    assert scan.angles == pytest.approx([-0.2, -0.1, 0.0, 0.1, 0.2])
    assert np.all(scan.ranges == np.inf)


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        (flaser([2.0] * 181)[:200] + "\n", "expected 181 ranges and 9 more values"),
        (flaser([2.0] * 181).replace(" 2.0 ", " 2.o ", 1), "not a number: '2.o'"),
        ("FLASER\n", "ends before the number of ranges"),
        ("FLASER -3 1 2\n", "is '-3', not a whole number"),
        (flaser([2.0] * 181).replace("12.5", "nan"), "stamp: must be a finite number"),
        (robotlaser([1.0, 2.0])[:60] + "\n", "the line ends before|expected"),
        (robotlaser([1.0], range_max=0.0), "range_max: must be greater than range_min"),
        (robotlaser([1.0]).replace(" 0.01 ", " 0 "), "angle_increment: must not be 0"),
    ],
)
def test_a_broken_line_is_named_by_file_and_line(tmp_path: Path, broken: str, reason: str) -> None:
    path = write(tmp_path, "# first\n", broken)
    with pytest.raises(LogError, match=reason) as caught:
        list(read_carmen(path))
    assert str(caught.value).startswith(f"{path}:2: ")


def real(relative: str) -> Path:
    path = DATA / relative
    if not path.exists():
        pytest.skip(f"real data not found: {path}")
    return path


@pytest.mark.parametrize(
    ("log", "reference", "scans"),
    [
        ("mit-csail/mit-csail.clf", "mit-csail/reference.npz", 1988),
        ("fr079/fr079.log", "fr079/reference.npz", 4791),
    ],
)
def test_real_logs_agree_with_their_references(log: str, reference: str, scans: int) -> None:
    truth = np.load(real(reference))
    read = list(read_carmen(real(log)))
    assert len(read) == scans
    expected = truth["scans"].astype(np.float64)
    no_return = expected >= float(truth["range_max"])
    assert no_return.any()
    for index, scan in enumerate(read):
        assert scan.seq == index
        np.testing.assert_allclose(scan.angles, truth["angles"], atol=1e-9)
        np.testing.assert_array_equal(np.isposinf(scan.ranges), no_return[index])
        seen = ~no_return[index]
        np.testing.assert_allclose(scan.ranges[seen], expected[index][seen], atol=1e-5)
    if "odom" in truth:
        odometry = [scan.odometry.to_array() for scan in read if scan.odometry is not None]
        np.testing.assert_allclose(np.array(odometry), truth["odom"], atol=1e-9)
        np.testing.assert_allclose([scan.stamp for scan in read], truth["t"], atol=1e-6)


def test_a_real_robotlaser_log_is_read_whole() -> None:
    records = list(read_log(real("fr079/fr079-graph.log")))
    assert len(records) == 1464
    assert {len(record.scan) for record in records} == {360}


def test_compressed_logs_are_read_whatever_their_name(tmp_path: Path) -> None:
    plain = write(tmp_path, flaser([2.0] * 181), flaser([3.0] * 181))
    packed = tmp_path / "packed.clf.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    renamed = tmp_path / "packed.log"
    renamed.write_bytes(packed.read_bytes())
    for path in (packed, renamed):
        scans = list(read_carmen(path))
        assert [scan.ranges[0] for scan in scans] == [2.0, 3.0]
