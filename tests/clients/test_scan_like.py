"""What a robot may hold a scan in, and how it is cut into POSTs."""

from __future__ import annotations

import math
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from lineloom.errors import InvalidScanError
from lineloom.scan_like import MAX_BATCH_VALUES, batches, to_match_scan, to_wire
from lineloom.wire import Scan
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan as CoreScan

from tests.clients.fake_service import scan


def test_a_mapping_an_object_and_numpy_give_the_same_scan() -> None:
    plain = scan(3, odometry={"x": 1.0, "y": 2.0, "theta": 0.5})
    numbers = [1.03, math.nan, math.inf]
    core = CoreScan.checked(
        np.array(numbers),
        angle_min=-0.1,
        angle_increment=0.1,
        range_min=0.1,
        range_max=30.0,
        stamp=plain["stamp"],
        seq=3,
        odometry=Pose(1.0, 2.0, 0.5),
    )
    loose = SimpleNamespace(
        **plain | {"ranges": np.array(numbers, dtype=np.float64), "seq": np.int64(3)}
    )
    forms = [to_wire(form).model_dump_json() for form in (plain, core, loose)]
    assert forms[0] == forms[1] == forms[2]
    assert '"ranges":[1.03,null,"inf"]' in forms[0]


def test_fields_that_are_not_the_contracts_are_left_out() -> None:
    taken = to_wire(scan(1, robot="r", truth={"x": 0, "y": 0, "theta": 0}))
    assert "truth" not in taken.model_dump()


def test_changes_override_and_a_wire_scan_passes_through() -> None:
    first = to_wire(scan(1))
    assert to_wire(first) is first
    assert to_wire(first, seq=9, session="s").seq == 9


@pytest.mark.parametrize(
    ("broken", "field"),
    [
        ({"stamp": "now"}, "stamp"),
        ({"ranges": []}, "ranges"),
        ({"ranges": [1.0, "far"]}, "ranges"),
        ({"seq": -1}, "seq"),
        ({"odometry": {"x": 1.0}}, "odometry/y"),
        ({"odometry": object()}, "odometry/x"),
    ],
)
def test_a_broken_scan_names_its_field(broken: dict[str, Any], field: str) -> None:
    with pytest.raises(InvalidScanError) as caught:
        to_wire(scan(1) | broken)
    assert caught.value.field.startswith(field)


def test_a_scan_without_stamp_is_for_matching_only() -> None:
    bare = {key: value for key, value in scan(1).items() if key not in ("seq", "stamp")}
    assert to_match_scan(bare).seq == 0
    with pytest.raises(InvalidScanError, match="stamp"):
        to_wire(bare)


def test_batches_keep_order_and_both_limits() -> None:
    parts = list(batches((scan(n) for n in range(25)), 10))
    assert [len(part) for part in parts] == [10, 10, 5]
    assert [entry.seq for part in parts for entry in part] == list(range(25))
    wide = Scan.model_validate(scan(0) | {"ranges": [1.0] * 20_000})
    parts = list(batches([wide] * 45, 1000))
    assert [len(part) for part in parts] == [20, 20, 5]
    assert all(sum(len(s.ranges) for s in part) <= MAX_BATCH_VALUES for part in parts)
    assert list(batches([], 10)) == []


@pytest.mark.parametrize("size", [0, 1001])
def test_a_batch_has_the_contracts_size(size: int) -> None:
    with pytest.raises(ValueError, match="1 to 1000"):
        list(batches([scan(0)], size))


def test_a_robots_client_needs_neither_numpy_nor_core_nor_service() -> None:
    script = (
        "import sys, lineloom, lineloom.wire\n"
        "heavy = {'numpy', 'numba', 'gtsam', 'lineloom_core', 'lineloom_service', 'typer'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=30
    )
    assert done.stdout.strip() == "[]"
