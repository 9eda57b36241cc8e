"""JSON lines: exact round trip, the contract's null and infinity rules, and broken lines."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.io.jsonl import (
    JsonLinesError,
    ScanRecord,
    read_jsonl,
    record_to_json,
    write_jsonl,
)
from lineloom_core.scan import Scan


def line(**changes: Any) -> dict[str, Any]:
    fields: dict[str, Any] = {
        "seq": 4,
        "stamp": 1.5,
        "angle_min": -0.1,
        "angle_increment": 0.1,
        "range_min": 0.1,
        "range_max": 30.0,
        "ranges": [1.0, None, "inf"],
    }
    return {key: value for key, value in (fields | changes).items() if value != "absent"}


def write(folder: Path, *lines: object) -> Path:
    path = folder / "scans.jsonl"
    path.write_text("".join(json.dumps(entry) + "\n" for entry in lines), encoding="utf-8")
    return path


def test_records_come_back_exactly(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    ranges = rng.uniform(0.05, 35.0, 90)
    ranges[[2, 3]] = np.nan
    records = [
        ScanRecord(
            Scan.checked(
                ranges,
                angle_min=-1.0,
                angle_increment=0.02,
                range_min=0.1,
                range_max=30.0,
                stamp=1134864629.895182,
                seq=seq,
                session="b",
                time_increment=1e-5,
                scan_time=0.1,
                odometry=Pose(1.0 / 3.0, -2.0, 0.1),
            ),
            robot="r1",
            truth=Pose(0.1, 0.2, -3.0),
        )
        for seq in range(3)
    ]
    path = tmp_path / "round.jsonl"
    assert write_jsonl(path, records) == 3
    for before, after in zip(records, read_jsonl(path), strict=True):
        np.testing.assert_array_equal(before.scan.ranges, after.scan.ranges)
        assert record_to_json(before) == record_to_json(after)
        assert (after.robot, after.truth) == ("r1", Pose(0.1, 0.2, -3.0))


def test_null_and_infinities_mean_what_the_contract_says(tmp_path: Path) -> None:
    path = write(tmp_path, line(ranges=[None, "inf", "-inf", 31, 0.05, 2]))
    (record,) = read_jsonl(path)
    expected = [np.nan, np.inf, -np.inf, np.inf, -np.inf, 2.0]
    np.testing.assert_array_equal(record.scan.ranges, expected)
    assert (record.robot, record.truth, record.scan.odometry) == (None, None, None)


def test_blank_lines_are_passed_over_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "gaps.jsonl"
    path.write_text(f"\n{json.dumps(line())}\n\n{{broken\n", encoding="utf-8")
    records = read_jsonl(path)
    assert next(records).scan.seq == 4
    with pytest.raises(JsonLinesError, match=r"gaps\.jsonl:4: not JSON"):
        next(records)


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        ([1, 2], "scan: must be a JSON object"),
        (line(stamp="absent"), "stamp: is missing"),
        (line(stamp="soon"), "stamp: must be a finite number"),
        (line(range_max=10**400), "range_max: must be a finite number"),
        (line(ranges="absent"), "ranges: must be a list"),
        (line(ranges=[1.0, "far"]), "ranges/1: is neither"),
        (line(ranges=[float("nan")]), "ranges/0: is neither"),
        (line(ranges=[10**400]), "ranges/0: is neither"),
        (line(ranges=[True]), "ranges/0: is neither"),
        (line(seq=1.5), "seq: must be a whole number"),
        (line(session=3), "session: must be a string"),
        (line(odometry={"x": 1, "y": 2}), "odometry/theta: is missing"),
        (line(odometry=[1, 2, 3]), "odometry: must be an object"),
        (line(angle_max=9.0), "angle_max: disagrees with 3 ranges"),
        (line(rangs=[1]), "rangs: is not a field of a scan"),
    ],
)
def test_a_broken_line_names_file_line_and_field(
    tmp_path: Path, broken: object, reason: str
) -> None:
    path = write(tmp_path, line(), broken)
    with pytest.raises(JsonLinesError, match=reason) as caught:
        list(read_jsonl(path))
    assert str(caught.value).startswith(f"{path}:2: ")
