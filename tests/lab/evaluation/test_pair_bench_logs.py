"""Pairs drawn from logs, of lidars derived from the recorded one, told by halves."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from lineloom_lab.evaluation.pair_bench import run_pair_bench
from lineloom_lab.evaluation.pair_bench_contestants import Contestant
from lineloom_lab.evaluation.pair_bench_lidars import DERIVED, RECORDED
from lineloom_lab.evaluation.pair_bench_logs import GROUPS, LEAST_OVERLAP, log_sets
from lineloom_lab.evaluation.pair_bench_report import to_json, to_markdown
from lineloom_lab.evaluation.pair_bench_sets import overlap_share
from lineloom_lab.simulation import rectangle, scanner_360

LIDARS = {lidar.name: lidar for lidar in DERIVED}
STEP_M = 0.4


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One log of half A, to and fro through a hall of 24 m, and one of half B."""
    base = tmp_path_factory.mktemp("logs")
    (base / "sparse").mkdir()
    world, lidar, rng = rectangle(24.0, 9.0), scanner_360(), np.random.default_rng(5)
    ways = np.concatenate([np.arange(3.0, 21.0, STEP_M), np.arange(21.0, 3.0, -STEP_M)])
    poses = [Pose(x, 4.0, 0.1 if i < len(ways) // 2 else 0.7) for i, x in enumerate(ways)]
    scans = [lidar.scan(world, pose, rng) for pose in poses]
    for name in ("seattle", "orebro"):
        np.savez(
            base / "sparse" / f"{name}.npz",
            scans=np.array([np.nan_to_num(s.ranges, posinf=0.0) for s in scans]),
            angle_min=scans[0].angle_min,
            angle_increment=scans[0].angle_increment,
            range_max=scans[0].range_max,
            t=np.arange(len(scans), dtype=float),
            ref=np.array([pose.to_array() for pose in poses]),
            odom=np.full((len(scans), 3), np.nan),
        )
    return base


def test_pairs_of_a_log_lie_as_their_group_says(folder: Path) -> None:
    sets, again = list(log_sets(folder, 6)), list(log_sets(folder, 6))
    assert [s.collection for s in sets] == ["as recorded, B", "as recorded, A"]
    for one, other in zip(sets, again, strict=True):
        assert {p.group for p in one.pairs} == set(GROUPS)
        for p, q in zip(one.pairs, other.pairs, strict=True):
            assert p.pair.T_ref_cur == q.pair.T_ref_cur
            T = p.pair.T_ref_cur
            away, turned = math.hypot(T.x, T.y), abs(T.theta)
            if p.group in ("near", "skip"):
                assert away < 2.1 * STEP_M
            elif p.group == "mid":
                assert away < 1.5
                assert turned <= math.pi / 3
            elif p.group == "far":
                assert away < 4.0
                assert away >= 1.5 or turned > math.pi / 3
            else:
                assert away > 12.0
            if p.group != "neg":
                assert overlap_share(p.pair.reference, p.pair.current, T) >= LEAST_OVERLAP


def test_both_halves_stand_side_by_side(folder: Path) -> None:
    class Blind:
        name = "blind"

        def prepare(self, scan: Scan) -> Scan:
            return scan

        def match_prepared(self, reference: Scan, current: Scan) -> MatchResult:
            return MatchResult("none", None, None, None, 0.1, "blind", best=Pose.identity())

    sets = list(log_sets(folder, 3, (RECORDED, LIDARS["57°"])))
    rows = run_pair_bench([Contestant("blind", "baseline", Blind)], sets)
    text = to_markdown(rows, sets)
    header = next(line for line in text.splitlines() if line.startswith("| lidar"))
    assert [c.strip() for c in header.strip("|").split("|")][1:3] == ["near A", "near B"]
    assert any(line.startswith("| seattle") for line in text.splitlines())
    assert {s["half"] for s in to_json(rows, sets)["sets"]} == {"A", "B"}


def test_derived_lidars_change_what_their_names_say() -> None:
    rng = np.random.default_rng(0)
    scan = scanner_360().scan(rectangle(24.0, 9.0), Pose(3.0, 4.0, 0.3), rng)
    fewer = LIDARS["1 of 4 beams"].of(scan, rng)
    np.testing.assert_array_equal(fewer.points(), scan.points()[::4])
    near = LIDARS["6 m"].of(scan, rng)
    assert near.range_max == 6.0
    assert 0 < np.isfinite(near.ranges).sum() < len(scan)
    assert np.nanmax(near.ranges) < 6.0
    narrow = LIDARS["57°"].of(scan, rng)
    middle = scan.angle_min + math.pi
    assert np.ptp(narrow.angles) == pytest.approx(math.radians(57.0), abs=scan.angle_increment)
    assert np.mean(narrow.angles) == pytest.approx(middle, abs=2 * scan.angle_increment)
    at = np.searchsorted(scan.angles, narrow.angle_min - 1e-9)
    np.testing.assert_array_equal(narrow.ranges, scan.ranges[at : at + len(narrow)])
    noisy = LIDARS["+ 30 mm"].of(scan, rng)
    assert np.nanstd(noisy.ranges - scan.ranges) == pytest.approx(0.03, rel=0.2)
    holed = LIDARS["− 30 % of beams"].of(scan, rng)
    lost = np.isfinite(scan.ranges) & np.isnan(holed.ranges)
    assert lost.mean() == pytest.approx(0.3, abs=0.08)


def test_a_folder_without_logs_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no logs"):
        list(log_sets(tmp_path, 3))
