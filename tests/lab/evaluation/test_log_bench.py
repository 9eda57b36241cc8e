"""The benchmark of logs: on small simulated logs, from files, and as a command."""

from __future__ import annotations

import gzip
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from lineloom.cli.app import app
from lineloom_core.geometry import Pose
from lineloom_core.io.jsonl import ScanRecord, record_to_json
from lineloom_lab.evaluation.log_bench import LogCase, LogResult, robots_of, run_log_bench
from lineloom_lab.evaluation.log_bench_cases import (
    Setting,
    combined_settings,
    full_settings,
    quick_settings,
)
from lineloom_lab.evaluation.log_bench_clocks import CLOCK_NAMES, with_clock
from lineloom_lab.evaluation.log_bench_files import log_files
from lineloom_lab.evaluation.log_bench_halves import pools_by_half
from lineloom_lab.evaluation.log_bench_judge import PlacedRobot
from lineloom_lab.evaluation.log_bench_log import BenchLog, Half, Recording, half_of
from lineloom_lab.evaluation.log_bench_report import to_json, to_markdown
from lineloom_lab.experiments.worst_steps import StepAlbum, draw_worst_steps, overlap_share
from lineloom_lab.simulation import SimulatedRobot, rooms, sick_lms200
from typer.testing import CliRunner

WORLD = rooms(3)


@cache
def recording() -> Recording:
    """Half a minute through a furnished flat."""
    driver = SimulatedRobot.wandering("r", WORLD, lidar=sick_lms200(), seed=4, duration_s=24.0)
    seen = list(driver.scans())
    truth = np.array([s.true_pose.to_array() for s in seen])
    scans = tuple(replace(s.scan, odometry=s.true_pose) for s in seen)
    return Recording("r", scans, truth)


@dataclass(frozen=True)
class Small:
    """A short log, to be run in no time."""

    name: str = "small"
    half: Half = "A"
    scans: int = 120
    broken: bool = False

    def load(self) -> BenchLog:
        if self.broken:
            raise ValueError("small: is broken")
        whole = recording()
        part = Recording("r", whole.scans[: self.scans], whole.reference[: self.scans])
        return BenchLog((part,), "reference")


@pytest.fixture(scope="module")
def results() -> tuple[LogResult, ...]:
    sources = (Small(), Small("short", "B", 20), Small("bad", "", broken=True))
    return run_log_bench([LogCase(s, setting) for s in sources for setting in quick_settings()])


def test_a_small_log_becomes_one_right_map(results: tuple[LogResult, ...]) -> None:
    whole = results[0]
    assert whole.figures is not None
    assert whole.steps is not None
    assert whole.figures.scans == 120
    assert whole.figures.share_in_largest == 1.0
    assert whole.figures.ate_rmse is not None
    assert whole.figures.ate_rmse < 0.1
    assert (whole.figures.relations_wrong, whole.steps.wrong, whole.steps.breaks) == (0, 0, 0)
    assert whole.cpu_ms > 0.0
    cut = results[1].figures
    assert cut is not None
    assert (cut.scans, cut.robots) == (120, 3)


def test_a_log_that_cannot_be_read_is_told_and_not_counted(results: tuple[LogResult, ...]) -> None:
    assert results[-1].unreadable == "small: is broken"
    assert "bad: small: is broken" in to_markdown(results)
    assert {half for _, half in pools_by_half(results)} == {"A", "B"}


def test_halves_stand_side_by_side(results: tuple[LogResult, ...]) -> None:
    pools = pools_by_half(results)
    assert [(setting.parts, half, pool.logs) for (setting, half), pool in pools.items()] == [
        (1, "A", 1), (1, "B", 1), (3, "A", 1), (3, "B", 1),
    ]  # fmt: skip
    assert pools[Setting(), "A"].whole == 1
    table = to_markdown(results)
    assert "| in largest % A " in table
    assert "| in largest % B " in table
    document = json.loads(json.dumps(to_json(results)))
    assert document["rows"][0]["share_in_largest"] == 1.0
    assert [row["half"] for row in document["halves"]] == ["A", "B", "A", "B"]


def test_the_same_log_gives_the_same_figures(results: tuple[LogResult, ...]) -> None:
    again = run_log_bench([LogCase(Small(), quick_settings()[0])])
    assert replace(again[0], cpu_ms=0.0) == replace(results[0], cpu_ms=0.0)


def test_a_log_is_cut_and_thinned_as_if_the_rest_had_never_been() -> None:
    log = BenchLog((recording(),), "reference")
    robots = robots_of(log, Setting(parts=3, stride=2))
    count = len(recording().scans)
    assert [r.robot for r in robots] == ["r-0", "r-1", "r-2"]
    assert sum(len(r.scans) for r in robots) == math.ceil(count / 2)
    for robot in robots:
        assert [scan.seq for scan in robot.scans] == list(range(len(robot.scans)))
    kept = np.concatenate([r.reference for r in robots])
    np.testing.assert_array_equal(kept, recording().reference[::2])
    stamps = [scan.stamp for robot in robots for scan in robot.scans]
    assert stamps == [scan.stamp for scan in recording().scans[::2]]


def test_odometry_is_sent_only_where_it_is_asked_for() -> None:
    log = BenchLog((recording(),), "reference")
    without, with_wheels = (robots_of(log, Setting(odometry=o))[0] for o in (False, True))
    assert {scan.odometry for scan in without.scans} == {None}
    assert [s.odometry for s in with_wheels.scans] == [s.odometry for s in recording().scans]


def test_a_map_with_odometry_stands_beside_wheels_alone() -> None:
    """The odometry of this log is the truth."""
    settings = (Setting(), Setting(odometry=True))
    without, with_wheels = run_log_bench([LogCase(Small(scans=30), s) for s in settings])
    assert without.wheels_rmse is None
    assert with_wheels.wheels_rmse == pytest.approx(0.0, abs=1e-9)
    assert "wheels m" not in to_markdown([without])
    assert "| wheels m " in to_markdown([with_wheels])
    assert "| worse A " in to_markdown([with_wheels])


def test_clocks_change_stamps_alone() -> None:
    scans = [replace(scan, time_increment=1e-4) for scan in recording().scans[:50]]
    true = np.array([scan.stamp for scan in scans])
    for clock in CLOCK_NAMES:
        told = with_clock(scans, clock)
        assert [id(scan.ranges) for scan in told] == [id(scan.ranges) for scan in scans]
    stamps = {c: np.array([s.stamp for s in with_clock(scans, c)]) for c in CLOCK_NAMES}
    np.testing.assert_array_equal(stamps["true"], true)
    np.testing.assert_allclose(np.diff(stamps["constant"]), 0.1)
    assert set(stamps["stopped"]) == {true[0]}
    np.testing.assert_allclose(np.diff(stamps["x20"]), 20.0 * np.diff(true))
    assert np.diff(stamps["jittered"]).min() < 0.0
    assert np.abs(stamps["jittered"] - true).max() <= 0.2
    assert with_clock(scans, "x3")[0].time_increment == pytest.approx(3e-4)
    assert with_clock(scans, "stopped")[0].time_increment == 1e-4


def test_what_another_clock_makes_of_a_log_is_held_against_the_true_one() -> None:
    clocks = ("true", "x3", "x20")
    runs = run_log_bench([LogCase(Small(scans=40), Setting(clock=clock)) for clock in clocks])
    assert runs[0].share_same is None
    assert all(run.share_same is not None and run.share_same <= 1.0 for run in runs[1:])
    alone = run_log_bench([LogCase(Small(scans=9), Setting(clock="x3"))])
    assert alone[0].share_same is None


def test_settings_are_all_different_and_nonsense_is_refused() -> None:
    full = full_settings()
    assert len(set(full)) == len(full) == 8 + len(CLOCK_NAMES) - 1
    assert set(quick_settings()) <= set(full)
    assert combined_settings([], [2, 4], []) == [Setting(stride=2), Setting(stride=4)]
    with pytest.raises(ValueError, match="no clock is named 'slow'; there are true"):
        combined_settings([], [], ["slow"])
    with pytest.raises(ValueError, match="counted from 1"):
        combined_settings([0], [], [])


def test_wrong_steps_and_breaks_are_drawn(tmp_path: Path) -> None:
    log = Small(scans=12)
    robots = robots_of(log.load(), Setting())
    right = robots[0].reference
    poses, names = right.copy(), np.array(["a"] * 9 + [""] + ["b"] * 2)
    poses[5:, 1] += 1.5
    placed = [PlacedRobot("r", poses, names, right)]
    StepAlbum(tmp_path)(LogCase(log, Setting()), robots, placed)
    ending = "small-one-robot-stride-1-clock-true"
    page = (tmp_path / f"wrong-steps-{ending}.svg").read_text()
    assert "the worst of 1 wrong steps" in page
    assert "r 4 to 5, 0.20 s: off by 1.50 m, 0.0 degrees" in page
    assert page.count(">true: ") == 1
    page = (tmp_path / f"breaks-{ending}.svg").read_text()
    assert "the worst of 2 breaks" in page
    assert "r 8 to 9, 0.20 s: 9 unplaced" in page
    assert page.count(">true: ") == 2
    assert (tmp_path / f"breaks-{ending}.png").read_bytes().startswith(b"\x89PNG")
    whole = [PlacedRobot("r", right, np.array(["a"] * 12), right)]
    assert draw_worst_steps("small", robots, whole) == []


def test_every_run_is_shown_to_a_witness() -> None:
    seen: list[tuple[str, int, int]] = []

    def look(case: LogCase, robots: Sequence[Recording], placed: Sequence[PlacedRobot]) -> None:
        seen.append((case.setting.name, len(robots), len(placed)))

    run_log_bench([LogCase(Small(scans=9), s) for s in quick_settings()], witness=look)
    assert [row[1:] for row in seen] == [(1, 1), (3, 3)]


def test_overlap_is_the_share_of_points_that_both_see() -> None:
    scan = recording().scans[0]
    assert overlap_share(scan, scan, Pose.identity()) == 1.0
    assert overlap_share(scan, scan, Pose(90.0, 0.0, 0.0)) == 0.0


def write_logs(folder: Path) -> None:
    """A folder as the real one: a log with a reference, and a field recording with a pseudo one."""
    whole = recording()
    ranges = np.array([scan.ranges for scan in whole.scans], dtype=np.float32)
    ranges[~np.isfinite(ranges)] = 0.0
    first = whole.scans[0]
    np.savez(
        folder / "csail.npz",
        scans=ranges[:60],
        angle_min=first.angle_min,
        angle_increment=first.angle_increment,
        range_max=first.range_max,
        t=0.2 * np.arange(60),
        ref=whole.reference[:60],
        odom=np.full((60, 3), np.nan),
    )
    field = folder / "field"
    field.mkdir()
    for name in ("flat", "flat-odometry", "flat-time-increment"):
        with gzip.open(field / f"{name}.jsonl.gz", "wt", encoding="utf-8") as lines:
            for scan in whole.scans[:40]:
                lines.write(json.dumps(record_to_json(ScanRecord(scan))) + "\n")
    np.savez(field / "flat.pseudo.npz", P=whole.reference[:40], SC=np.full(40, 0.95))


def test_files_are_read_as_they_are_posted(tmp_path: Path) -> None:
    write_logs(tmp_path)
    logs = {log.name: log for log in log_files(tmp_path)}
    assert list(logs) == ["csail", "flat", "flat-time-increment"]
    assert [log.half for log in logs.values()] == ["A", "B", "B"]
    read = logs["csail"].load()
    assert read.trust == "reference"
    true = recording().scans[0].ranges
    got = read.recordings[0].scans[0]
    hit = np.isfinite(true)
    np.testing.assert_allclose(got.ranges[hit], np.round(true[hit], 3), atol=1e-9)
    assert np.isnan(got.ranges[~hit]).all()
    assert got.odometry is None
    for name in ("flat", "flat-time-increment"):
        pseudo = logs[name].load()
        assert pseudo.trust == "pseudo"
        np.testing.assert_array_equal(pseudo.recordings[0].reference, recording().reference[:40])


def test_a_recording_with_odometry_stands_in_for_the_one_without(tmp_path: Path) -> None:
    write_logs(tmp_path)
    names = [log.name for log in log_files(tmp_path, odometry=True)]
    assert names == ["csail", "flat-odometry", "flat-time-increment"]


def test_a_pseudo_reference_of_other_scans_is_refused(tmp_path: Path) -> None:
    write_logs(tmp_path)
    np.savez(tmp_path / "field" / "flat.pseudo.npz", P=np.zeros((47, 3)), SC=np.ones(47))
    log = next(log for log in log_files(tmp_path) if log.name == "flat")
    with pytest.raises(ValueError, match="47 poses for 40 scans"):
        log.load()


def test_every_known_building_is_in_one_half() -> None:
    assert half_of("tinyslam-exp1") == "A"
    assert half_of("corridor-no-person") == "A"
    assert half_of("spin-lds01-odometry") == "B"
    assert half_of("somewhere-else") == ""


def test_the_command_prints_a_table_and_writes_a_document(tmp_path: Path) -> None:
    write_logs(tmp_path)
    file = tmp_path / "out" / "logs.json"
    line = ["bench", "logs", "--data", str(tmp_path), "--logs", "csa*,flat", "--quick"]
    ran = CliRunner().invoke(app, [*line, "--json", str(file)])
    assert ran.exit_code == 0, ran.output
    assert "| csail " in ran.stdout
    assert "| agree % " in ran.stdout
    rows = json.loads(file.read_text())["rows"]
    assert [(row["log"], row["parts"], row["trust"]) for row in rows] == [
        ("csail", 1, "reference"), ("csail", 3, "reference"),
        ("flat", 1, "pseudo"), ("flat", 3, "pseudo"),
    ]  # fmt: skip
    assert "csail, one robot" in ran.stderr


def test_the_command_names_the_logs_and_clocks_it_knows(tmp_path: Path) -> None:
    write_logs(tmp_path)
    line = ["bench", "logs", "--data", str(tmp_path)]
    for wrong, told in (
        (["--logs", "castle"], "there are csail, flat"),
        (["--clocks", "slow"], "there are true, constant"),
        (["--strides", "two"], "no whole numbers"),
    ):
        ran = CliRunner().invoke(app, [*line, *wrong])
        assert ran.exit_code == 2, ran.output
        assert told in ran.stderr
    nothing = CliRunner().invoke(app, ["bench", "logs", "--data", str(tmp_path / "none")])
    assert nothing.exit_code == 1
    assert "--data" in nothing.stderr
