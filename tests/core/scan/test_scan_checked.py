"""What `Scan.checked` refuses, and what it makes of values that are no distances."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.scan import MAX_BEAMS, InvalidScanError, Scan

INF, NAN = math.inf, math.nan
GOOD: dict[str, Any] = {
    "ranges": [1.0, 2.0, 3.0, 4.0, 5.0],
    "angle_min": -0.2,
    "angle_increment": 0.1,
    "range_min": 0.1,
    "range_max": 30.0,
    "stamp": 12.5,
    "seq": 7,
    "angle_max": 0.2,
    "time_increment": 1e-4,
    "scan_time": 0.1,
}


def checked(**changes: Any) -> Scan:
    fields = GOOD | changes
    return Scan.checked(fields.pop("ranges"), **fields)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *[
            (name, bad)
            for name in (
                "angle_min",
                "angle_increment",
                "range_min",
                "range_max",
                "stamp",
                "time_increment",
                "scan_time",
                "angle_max",
            )
            for bad in (NAN, INF, -INF)
        ],
        ("angle_increment", 0.0),
        ("angle_min", -90.0),  # degrees
        ("range_min", -0.01),
        ("range_max", 0.1),
        ("range_max", 0.05),
        ("range_max", -1.0),
        ("time_increment", -1e-9),
        ("scan_time", -1e-9),
        ("seq", -1),
        ("angle_max", 0.1),
        ("angle_max", -0.2),
        ("ranges", []),
        ("ranges", 3.0),
        ("ranges", [[1.0, 2.0], [3.0, 4.0]]),
        ("ranges", [1.0, "far", 3.0, 4.0, 5.0]),
        ("ranges", [1.0, [2.0], 3.0, 4.0, 5.0]),
        ("ranges", {"0": 1.0}),
        ("ranges", [1.0, 2.0 + 1.0j, 3.0, 4.0, 5.0]),
        ("odometry", Pose(NAN, 0.0, 0.0)),
        ("odometry", Pose(0.0, INF, 0.0)),
        ("odometry", Pose(0.0, 0.0, -INF)),
    ],
)
def test_what_cannot_be_is_refused_by_the_name_of_its_field(field: str, value: Any) -> None:
    with pytest.raises(InvalidScanError) as refused:
        checked(**{field: value})
    assert refused.value.field == field
    assert str(refused.value) == f"{field}: {refused.value.reason}"


def test_a_million_beams_are_refused_and_said_how_many() -> None:
    with pytest.raises(InvalidScanError, match="1000000") as refused:
        checked(ranges=np.ones(1_000_000), angle_increment=1e-6, angle_max=None)
    assert refused.value.field == "ranges"


def test_the_most_beams_are_taken_and_one_more_is_not() -> None:
    step = math.tau / MAX_BEAMS
    scan = checked(ranges=np.ones(MAX_BEAMS), angle_increment=step, angle_max=None)
    assert len(scan) == MAX_BEAMS
    with pytest.raises(InvalidScanError, match=str(MAX_BEAMS + 1)):
        checked(ranges=np.ones(MAX_BEAMS + 1), angle_increment=step, angle_max=None)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_more_than_a_full_turn_is_refused(sign: float) -> None:
    """A few degrees beyond are allowed: real scanners repeat the first beam."""
    one_degree = sign * math.radians(1.0)
    assert len(checked(ranges=np.ones(365), angle_increment=one_degree, angle_max=None)) == 365
    with pytest.raises(InvalidScanError, match="full turn") as refused:
        checked(ranges=np.ones(367), angle_increment=one_degree, angle_max=None)
    assert refused.value.field == "angle_increment"


@pytest.mark.parametrize("increment", [0.1, -0.1])
@pytest.mark.parametrize(("off", "fine"), [(0.0, True), (0.049, True), (-0.049, True),
                                           (0.051, False), (-0.051, False)])  # fmt: skip
def test_angle_max_may_be_off_by_half_an_increment(
    increment: float, off: float, fine: bool
) -> None:
    angle_max = -0.2 + 4 * increment + off
    if fine:
        assert len(checked(angle_increment=increment, angle_max=angle_max)) == 5
        return
    with pytest.raises(InvalidScanError) as refused:
        checked(angle_increment=increment, angle_max=angle_max)
    assert refused.value.field == "angle_max"


def test_angle_max_may_be_left_out() -> None:
    assert len(checked(angle_max=None)) == 5


def test_values_that_are_no_distances_say_what_they_mean() -> None:
    raw = [NAN, 29.999, 30.0, 81.9, INF, 0.1, 0.0999, 0.0, -1.0, -INF, None]
    scan = checked(ranges=raw, angle_max=None)
    np.testing.assert_array_equal(
        scan.ranges, [NAN, 29.999, INF, INF, INF, 0.1, -INF, -INF, -INF, -INF, NAN]
    )


def test_a_sweep_of_nothing_but_no_returns_is_a_scan_without_points() -> None:
    for nothing in (NAN, INF, -INF):
        scan = checked(ranges=[nothing] * 5)
        assert len(scan) == 5
        assert scan.points().shape == (0, 2)


def test_a_scan_keeps_a_copy_that_nobody_can_write_to() -> None:
    mine = np.array([1.0, 40.0, 3.0, 4.0, 5.0])
    scan = checked(ranges=mine)
    assert mine[1] == 40.0
    mine[0] = 9.0
    assert scan.ranges[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        scan.ranges[0] = 2.0


def test_ranges_become_contiguous_float64_whatever_they_were() -> None:
    wide = np.arange(1, 11, dtype=np.int32)[::2]
    scan = checked(ranges=wide)
    assert scan.ranges.dtype == np.float64
    assert scan.ranges.flags.c_contiguous
    np.testing.assert_array_equal(scan.ranges, [1.0, 3.0, 5.0, 7.0, 9.0])


def test_everything_else_is_kept_as_given() -> None:
    odometry = Pose(1.0, 2.0, 0.3)
    scan = checked(session="morning", odometry=odometry)
    assert (scan.angle_min, scan.angle_increment) == (-0.2, 0.1)
    assert (scan.range_min, scan.range_max, scan.stamp) == (0.1, 30.0, 12.5)
    assert (scan.seq, scan.session, scan.odometry) == (7, "morning", odometry)
    assert (scan.time_increment, scan.scan_time) == (1e-4, 0.1)
