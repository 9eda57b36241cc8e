"""The simulated ladders: what their rungs vary, and that they run."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lineloom.cli.app import app
from lineloom_lab.evaluation import log_bench_ladders
from lineloom_lab.evaluation.log_bench import LogCase, run_log_bench
from lineloom_lab.evaluation.log_bench_cases import Setting
from lineloom_lab.evaluation.log_bench_ladder_report import ladders_json, ladders_markdown
from lineloom_lab.evaluation.log_bench_ladders import Conditions, Rung, SimulatedLog, ladder_rungs
from typer.testing import CliRunner

SLOW = Rung("rate, Hz", 2.0, Conditions(rate_hz=2.0))


def test_ladders_reach_as_far_as_lidars_do() -> None:
    rungs = ladder_rungs()
    assert len({rung.name for rung in rungs}) == len(rungs)
    values: dict[str, list[float]] = {}
    for rung in rungs:
        values.setdefault(rung.ladder, []).append(rung.value)
    ends = {name: (min(found), max(found)) for name, found in values.items()}
    assert ends == {
        "beams": (45, 1080),
        "view, degrees": (57, 360),
        "range, m": (4, 80),
        "noise, mm": (5, 50),
        "rate, Hz": (1, 40),
        "turn, rad/s": (0.5, 3),
        "turn untold, rad/s": (0.5, 3),
        "people": (0, 8),
        "followers": (1, 4),
    }


def test_every_rung_is_a_lidar_that_looks_ahead() -> None:
    for rung in ladder_rungs():
        lidar, conditions = rung.conditions.lidar(), rung.conditions
        assert lidar.beams == conditions.beams
        assert lidar.angle_min == pytest.approx(-math.radians(conditions.view_deg) / 2)
        sweep = math.degrees(lidar.angle_increment * (lidar.beams - 1))
        full = conditions.view_deg == 360.0
        assert sweep == pytest.approx(360.0 - 360.0 / lidar.beams if full else conditions.view_deg)


def test_a_rung_changes_what_it_says_and_nothing_else() -> None:
    plain = SimulatedLog(Rung("people", 0.0, Conditions()), 1, 4.0).load().recordings[0]
    noisy = SimulatedLog(Rung("noise, mm", 50.0, Conditions(noise_mm=50.0)), 1, 4.0).load()
    np.testing.assert_array_equal(noisy.recordings[0].reference, plain.reference)
    a, b = plain.scans[5].ranges, noisy.recordings[0].scans[5].ranges
    both = np.isfinite(a) & np.isfinite(b)
    assert 0.03 < float(np.std((a - b)[both])) < 0.07
    crowd = SimulatedLog(Rung("people", 8.0, Conditions(people=8)), 1, 4.0).load().recordings[0]
    np.testing.assert_array_equal(crowd.reference, plain.reference)
    assert any(
        np.nanmax(np.abs(np.where(np.isfinite(s.ranges), s.ranges, 0.0)
                         - np.where(np.isfinite(t.ranges), t.ranges, 0.0))) > 0.5
        for s, t in zip(crowd.scans, plain.scans, strict=True)
    )  # fmt: skip


def test_a_sweep_is_told_or_not() -> None:
    fast = Conditions(turn_rate=3.0, swept=0.75)
    logs = (SimulatedLog(Rung("turn", 3.0, replace(fast, told=t)), 2, 3.0) for t in (True, False))
    told, untold = (log.load().recordings[0].scans for log in logs)
    assert told[0].time_increment == pytest.approx(0.75 / (10.0 * 360))
    assert untold[0].time_increment == 0.0
    np.testing.assert_array_equal(told[9].ranges, untold[9].ranges)


def test_seeds_take_turns_through_the_buildings() -> None:
    names = [SimulatedLog(SLOW, seed).name for seed in range(4)]
    assert names == [
        "rate, Hz 2, office 0", "rate, Hz 2, flat 1", "rate, Hz 2, corridors 2",
        "rate, Hz 2, office 3",
    ]  # fmt: skip


def test_rungs_are_told_with_all_their_buildings() -> None:
    logs = [SimulatedLog(SLOW, seed, 8.0) for seed in range(2)]
    results = run_log_bench([LogCase(log, Setting()) for log in logs])
    told = [(log.rung, result) for log, result in zip(logs, results, strict=True)]
    document = json.loads(json.dumps(ladders_json(told)))
    assert [row["log"] for row in document["rows"]] == [log.name for log in logs]
    assert [(r["ladder"], r["value"], r["logs"]) for r in document["rungs"]] == [("rate, Hz", 2, 2)]
    assert document["rungs"][0]["share_steps_right"] > 0.9
    assert "| rate, Hz 2 " in ladders_markdown(told)


def test_the_command_runs_the_rungs_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_bench_ladders, "ladder_rungs", lambda: [SLOW])
    line = ["bench", "ladders", "--only", "rate", "--quick", "--odometry", "--json", "-"]
    ran = CliRunner().invoke(app, line)
    assert ran.exit_code == 0, ran.output
    document = json.loads(ran.stdout)
    assert [(row["log"], row["odometry"]) for row in document["rows"]] == [
        ("rate, Hz 2, office 0", True)
    ]
    castle = CliRunner().invoke(app, ["bench", "ladders", "--only", "castle"])
    assert castle.exit_code == 2
    assert "rate, Hz" in castle.stderr


@pytest.mark.long
def test_two_jobs_give_what_one_gives() -> None:
    cases = [LogCase(SimulatedLog(SLOW, seed, 20.0), Setting()) for seed in range(3)]
    alone, together = run_log_bench(cases), run_log_bench(cases, jobs=2)
    assert [replace(r, cpu_ms=0.0) for r in alone] == [replace(r, cpu_ms=0.0) for r in together]
