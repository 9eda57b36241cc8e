"""The six runs of a Hokuyo URG-04LX in the same two rooms (Mines ParisTech)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.scan import Scan

from tests.scenarios.real_logs import DATA

FOLDER = DATA / "tinyslam"
RUNS = ("exp1", "exp2", "exp3", "exp4", "test_lab", "test_lab2")
_BEAMS = 682
_STEP_RAD = math.tau / 1024
_FIRST_RANGE = {"test_lab": 13}
_FIRST_RANGE_OTHERWISE = 25
_SWEEP_S = 0.1  # a full turn, by the data sheet


def require() -> None:
    """Skip where the data is not there."""
    if not FOLDER.is_dir():
        pytest.skip(f"no real data: {FOLDER} is missing")


def read(run: str) -> list[Scan]:
    """All whole scans of a run, with their beams timed as the lidar's driver would."""
    first = _FIRST_RANGE.get(run, _FIRST_RANGE_OTHERWISE)
    scans: list[Scan] = []
    for line in (FOLDER / f"{run}.dat").read_text().splitlines():
        row = np.array(line.split(), dtype=np.float64)
        if len(row) != first + _BEAMS:
            continue  # the last line of a file may be cut off
        ranges = row[first:] * 1e-3
        ranges[ranges < 0.02] = np.nan  # below 20 mm the lidar writes error codes
        scans.append(
            Scan.checked(
                ranges,
                angle_min=-_STEP_RAD * (_BEAMS - 1) / 2,
                angle_increment=_STEP_RAD,
                range_min=0.02,
                range_max=5.6,
                stamp=row[0] * 1e-6,
                seq=len(scans),
                time_increment=_SWEEP_S / 1024,
                scan_time=_SWEEP_S,
            )
        )
    return scans
