"""tinySLAM's logs: made-up rows, and the real ones."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.io.log_scan import LogError
from lineloom_core.io.tinyslam import BEAMS, read_log

REAL = Path(__file__).resolve().parents[4] / "shared" / "data" / "tinyslam"


def row(columns: int, stamp_us: int, ranges: list[int], extra: int = 0) -> str:
    words = [str(stamp_us), *["7"] * (columns - 1), *map(str, ranges), *["9"] * extra]
    return " ".join(words) + " \n"


@pytest.mark.parametrize(("columns", "extra"), [(13, 0), (24, 0), (24, 1)])
def test_rows_of_each_log(tmp_path: Path, columns: int, extra: int) -> None:
    ranges = [1000] * BEAMS
    ranges[0], ranges[1], ranges[681] = 0, 7, 5600
    path = tmp_path / "run.dat"
    path.write_text(row(columns, 2_500_000, ranges, extra) * 2 + "1 2 3")
    first, second = (found.scan for found in read_log(path))
    assert (first.seq, second.seq) == (0, 1)
    assert first.stamp == 2.5
    assert np.isnan(first.ranges[:2]).all()
    assert first.ranges[2] == 1.0
    assert first.ranges[681] == np.inf
    assert math.degrees(first.angles[0]) == pytest.approx(-120.0)
    assert math.degrees(first.angles[-1]) == pytest.approx(120.0)


def test_broken_rows_are_told(tmp_path: Path) -> None:
    path = tmp_path / "run.dat"
    path.write_text("1 2 3\n" + row(24, 1, [1000] * BEAMS))
    with pytest.raises(LogError, match=r"run.dat:1: 3 numbers in a row"):
        list(read_log(path))
    path.write_text(row(24, 1, [1000] * BEAMS).replace("1000", "x", 1) * 2)
    with pytest.raises(LogError, match=r"run.dat:1: "):
        list(read_log(path))


@pytest.mark.skipif(not REAL.is_dir(), reason=f"no logs in {REAL}")
@pytest.mark.parametrize(("name", "scans"), [("exp3", 525), ("test_lab", 590), ("test_lab2", 404)])
def test_real_logs(name: str, scans: int) -> None:
    found = [entry.scan for entry in read_log(REAL / f"{name}.dat")]
    assert len(found) == scans
    seen = np.array([np.isfinite(scan.ranges).mean() for scan in found])
    assert seen.mean() > 0.3
    gaps = np.diff([scan.stamp for scan in found])
    assert 0.02 < np.median(gaps) < 0.5
