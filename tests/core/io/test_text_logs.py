"""Recordings as numpy, `rostopic echo -p` and DP-SLAM have them; and what is amiss with others."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lineloom_core.io import dpslam, npz, rostopic
from lineloom_core.io.log_scan import LogError

RANGES = np.array([[1.0, 2.0, np.nan], [1.5, np.inf, 3.0]])


def _arrays(**changes: Any) -> dict[str, Any]:
    arrays: dict[str, Any] = {
        "ranges": RANGES,
        "stamps": np.array([5.0, 5.5]),
        "angle_min": -1.0,
        "angle_increment": 1.0,
        "range_max": 30.0,
        **changes,
    }
    return {name: value for name, value in arrays.items() if value is not None}


def _saved(path: Path, **changes: Any) -> Path:
    np.savez(path / "log.npz", **_arrays(**changes))
    return path / "log.npz"


def test_numpy_arrays(tmp_path: Path) -> None:
    wheels = np.array([[1.0, 2.0, 0.5], [np.nan, 0.0, 0.0]])
    first, second = (found.scan for found in npz.read_log(_saved(tmp_path, odometry=wheels)))
    np.testing.assert_array_equal(first.ranges, RANGES[0])
    assert (first.stamp, first.seq, second.stamp, second.seq) == (5.0, 0, 5.5, 1)
    assert first.odometry is not None
    assert first.odometry.theta == 0.5
    assert second.odometry is None


def test_numpy_arrays_under_their_other_names(tmp_path: Path) -> None:
    other = {"scans": np.array([[0.0, 2.0, 1.0]]), "t": [7.0], "ranges": None, "stamps": None}
    (found,) = npz.read_log(_saved(tmp_path, **other))
    np.testing.assert_array_equal(found.scan.ranges, [np.nan, 2.0, 1.0])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"stamps": None}, "stamps is missing; there is: angle_increment"),
        ({"range_max": None}, "range_max is missing"),
        ({"stamps": np.zeros(3)}, r"ranges must be \(n, beams\) and stamps \(n,\)"),
        ({"odometry": np.zeros((2, 2))}, r"odometry must be \(2, 3\)"),
        ({"angle_increment": 0.0}, "angle_increment: must not be 0"),
    ],
)
def test_numpy_arrays_that_do_not_fit_are_named(
    changes: dict[str, Any], said: str, tmp_path: Path
) -> None:
    with pytest.raises(LogError, match=said):
        list(npz.read_log(_saved(tmp_path, **changes)))


def test_what_is_no_npz_is_told(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    path.write_bytes(b"PK not really")
    with pytest.raises(LogError):
        list(npz.read_log(path))


def test_rostopic_echo(tmp_path: Path) -> None:
    path = tmp_path / "scans.csv"
    path.write_text(
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.angle_min,"
        "field.angle_max,field.angle_increment,field.time_increment,field.scan_time,"
        "field.range_min,field.range_max,field.ranges0,field.ranges1,field.ranges2\n"
        "1700000000100000000,3,1700000000000000000,laser,-1.0,1.0,1.0,0.0,0.1,0.1,30.0,1.0,inf,nan\n"
        "1700000000200000000,4,1700000000100000000,laser,-1.0,1.0,1.0,0.0,0.1,0.1,30.0,2.0,2.5,\n"
    )
    first, second = (found.scan for found in rostopic.read_log(path))
    np.testing.assert_array_equal(first.ranges, [1.0, np.inf, np.nan])
    assert first.stamp == 1_700_000_000.0
    assert (second.seq, second.scan_time, len(second.ranges)) == (1, 0.1, 2)


def test_another_table_is_refused_with_the_next_step(tmp_path: Path) -> None:
    path = tmp_path / "scans.csv"
    path.write_text("stamp,r0,r1\n0.0,1.0,2.0\n")
    with pytest.raises(LogError, match=r"scans.csv:1: no column field.angle_min.*\.npz"):
        list(rostopic.read_log(path))


def test_dpslam(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    path.write_text("Odometry 1.0 2.0 0.5\nLaser 3 1.0 2.0 9.0\n\nLaser 3 1.0 2.0 3.0\n")
    first, second = (found.scan for found in dpslam.read_log(path))
    np.testing.assert_array_equal(first.ranges, [1.0, 2.0, np.inf])
    assert (first.angle_min, first.angle_increment) == (-math.pi / 2, math.pi / 2)
    assert first.odometry is not None
    assert second.odometry is None
    assert second.stamp > first.stamp
    path.write_text("Laser 4 1.0 2.0 3.0\n")
    with pytest.raises(LogError, match=r"run\.log:1: Laser: 4 beams are told, 3 are there"):
        list(dpslam.read_log(path))
