"""The benchmark's own arithmetic: what a goal and a ratio mean; and that it runs."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.benchmarks.capacity import HEAD as CAPACITY_HEAD
from tests.benchmarks.capacity import Looks, Trial, percentile
from tests.benchmarks.paced_fleet import PacedFleet
from tests.benchmarks.row import Row, median_seconds, table
from tests.benchmarks.site_sizes import HEAD, SiteSize

FAST = Row("a", 50.0, "µs", "lower", 60.0, "twin", 500.0)
MANY = Row("b", 80.0, "x", "higher", 40.0, "driving", 2.0)


def test_a_ratio_says_how_many_times_better() -> None:
    assert FAST.ratio == pytest.approx(10.0)
    assert MANY.ratio == pytest.approx(40.0)


def test_goals_look_the_right_way() -> None:
    assert FAST.reached is True
    assert replace(FAST, figure=61.0).reached is False
    assert MANY.reached is True
    assert replace(MANY, figure=39.0).reached is False
    assert replace(MANY, goal=None).reached is None


def test_the_table_shows_a_missed_goal() -> None:
    text = table([FAST, replace(MANY, figure=3.0)])
    assert text.splitlines()[2].split()[0] == "a"
    assert "yes" in text.splitlines()[2]
    assert "NO" in text.splitlines()[3]


def test_the_median_is_taken_after_one_run_for_nothing() -> None:
    seen: list[int] = []
    median_seconds(seen.append, [1, 2, 3], repeats=2)
    assert seen == [1, 1, 1, 2, 2, 3, 3]


def test_a_site_is_a_row_under_its_table_s_head() -> None:
    mib = 1024**2
    row = SiteSize(1000, 181, 64, 90, 200 * mib, 16 * mib, 2.5, 2 * mib, mib, 1.0, 2.0).row()
    cells = dict(zip(HEAD.splitlines()[0].split("|"), row.split("|"), strict=True))
    assert cells[" of it per keyframe "].strip() == "256 KiB"
    assert cells[" CPU per scan "].strip() == "2.5 ms"
    assert cells[" disk per scan "].strip() == "2.0 KiB"


def test_the_benchmark_runs_without_data_and_prints_json(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tests.benchmarks.run", "--quick", "--no-http", "--json"]
    done = subprocess.run(
        [*command, "--data", str(tmp_path)],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    rows = json.loads(done.stdout)["rows"]
    assert {row["name"].split(",")[0] for row in rows} == {
        *("features", "graph", "map", "pair", "place", "scan"),
    }
    assert all(row["ratio"] > 0.0 for row in rows)


def test_a_backlog_that_grows_by_more_than_a_second_s_scans_is_not_kept_up_with() -> None:
    looks = Looks(pending=[0, 0, 10, 10, 30, 30, 50, 50, 60, 60], delays=[0.5] * 50 + [2.0] * 50)
    trial = Trial(10, 1, 100.0, 0, looks, 10**9)
    assert looks.fifth(1) == 10.0
    assert looks.fifth(4) == 60.0
    assert trial.keeps_up
    assert not replace(trial, scans_per_s=49.0).keeps_up
    assert not replace(trial, refused=1).keeps_up
    assert len(trial.row().split("|")) == len(CAPACITY_HEAD.splitlines()[0].split("|"))
    assert percentile(looks.delays, 99) == 2.0


def test_a_scan_waits_from_when_it_was_sent_until_it_is_in_the_map() -> None:
    fleet = PacedFleet(0, {}, sent={("s", "r"): [(4, 10.0), (9, 10.5)], ("s", "q"): []})
    assert fleet.age_s("s", "r", None, 11.0) == 1.0
    assert fleet.age_s("s", "r", 4, 11.0) == 0.5
    assert fleet.age_s("s", "r", 9, 11.0) == 0.0
    assert fleet.age_s("s", "q", None, 11.0) is None
