"""Fitting the probability that a set is false."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.join_odds import WEIGHTS
from lineloom_lab.evaluation.join_calibration import (
    counted,
    described,
    fit_and_report,
    fit_monotone,
    probabilities,
    reliability,
)
from lineloom_lab.evaluation.join_fleets import (
    join_buildings,
    join_fleet,
    random_lidar,
    seen_from_another_height,
)
from lineloom_lab.evaluation.join_trials import Trial, trials
from lineloom_lab.simulation.aliased_buildings import hotel_floor


def test_the_fit_finds_what_the_truth_was_drawn_with() -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(6000, 3))
    true = np.array([1.5, 0.7, 0.0]), -0.8
    false = rng.random(len(x)) < probabilities(true, x)
    weights, bias = fit_monotone(x, false, np.ones(len(x)))
    assert weights == pytest.approx(true[0], abs=0.12)
    assert bias == pytest.approx(true[1], abs=0.12)


def test_no_weight_is_against_reason() -> None:
    rng = np.random.default_rng(2)
    x = rng.normal(size=(3000, 2))
    false = rng.random(len(x)) < probabilities((np.array([1.0, -0.6]), 0.0), x)
    weights, _ = fit_monotone(x, false, np.ones(len(x)))
    assert weights[0] > 0.5
    assert weights[1] == 0.0


def test_trials_of_one_pair_count_as_one() -> None:
    made = [Trial("office", 0, (0, 1), {}, False)] * 4 + [Trial("office", 0, (0, 2), {}, True)]
    assert counted(made).tolist() == [0.25] * 4 + [1.0]


def test_reliability_puts_what_was_beside_what_is_said() -> None:
    p, false = np.full(200, 0.05), np.arange(200) < 20
    (_, row) = reliability(p, false, np.ones(200)).splitlines()
    assert row.split() == ["3.00%", "–", "10.00%", "200", "5.00%", "10.00%"]


def test_another_height_takes_away_whole_pieces_of_furniture_alone() -> None:
    floor = hotel_floor(1)
    world = seen_from_another_height(floor, np.random.default_rng(1))
    before, after = (set(map(tuple, w.walls.tolist())) for w in (floor.world, world))
    gone = before - after
    assert after < before
    assert gone <= set(map(tuple, floor.telling.tolist()))
    corners = {tuple(np.round(row[i : i + 2], 3)) for row in gone for i in (0, 2)}
    kept = {tuple(np.round(row[i : i + 2], 3)) for row in after for i in (0, 2)}
    assert not corners & {c for c in kept if c in corners}


def test_fleets_are_the_same_for_the_same_seed_and_of_many_lidars() -> None:
    first, again = (join_fleet("flat", 5) for _ in range(2))
    assert [r.simulated.lidar for r in first.robots] == [r.simulated.lidar for r in again.robots]
    rng = np.random.default_rng(1)
    drawn = [random_lidar(rng) for _ in range(60)]
    assert {d.beams for d in drawn} == {45, 90, 181, 360, 720, 1080}
    assert min(d.range_sigma for d in drawn) < 0.008
    assert max(d.range_sigma for d in drawn) > 0.035


def test_trials_are_measured_and_judged_by_the_truth() -> None:
    assert "single room" in join_buildings()
    found = [t for seed in range(3) for t in trials("single room", seed)]
    assert found
    assert all(WEIGHTS.keys() - {"kin"} <= t.figures.keys() for t in found)
    assert np.isfinite(described(found)).all()
    assert any(not t.false for t in found)


def test_the_report_shows_what_one_half_says_of_the_other() -> None:
    rng = np.random.default_rng(4)
    made = []
    for seed in range(40):
        false = bool(rng.random() < 0.5)
        figures = dict.fromkeys(WEIGHTS, 1.0) | {
            "set_evidence": float(rng.uniform(20.0, 80.0) if false else rng.uniform(60.0, 400.0)),
            "set_seen": 1000.0,
            "set_missing": float(rng.uniform(0.0, 0.05)) if false else 0.0,
        }
        made.append(Trial("office", seed, (0, 1), figures, false))
    report = fit_and_report(made)
    assert report.startswith("PRIOR = ")
    assert "40 trials of 40 pairs, said by the other half:" in report
