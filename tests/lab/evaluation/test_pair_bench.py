"""The benchmark of pairwise matchers: on answers whose marks are known, and as a command."""

from __future__ import annotations

import json
import math
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lineloom.cli.app import app
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from lineloom_lab.evaluation.pair_bench import BenchRow, figures_of, run_pair_bench
from lineloom_lab.evaluation.pair_bench_contestants import CONTESTANTS, Contestant, chosen
from lineloom_lab.evaluation.pair_bench_report import to_json, to_markdown
from lineloom_lab.evaluation.pair_bench_sets import (
    BenchPair,
    BenchSet,
    overlap_share,
    real_sets,
    simulated_sets,
)
from lineloom_lab.evaluation.pairs import Pair, Tier
from lineloom_lab.evaluation.peers.points3d import (
    extruded,
    from_matrix,
    to_matrix,
    usable_points,
)
from lineloom_lab.simulation import rectangle, scanner_360
from typer.testing import CliRunner

SHARED = Path(__file__).parents[4] / "shared" / "data" / "pairs"
TRUTH = Pose(1.0, 2.0, 0.5)
SCAN = Scan.checked(
    [1.0, 2.0], angle_min=0.0, angle_increment=0.1, range_min=0.0, range_max=9.0, stamp=0.0
)
PEERS = [c for c in CONTESTANTS if c.kind == "peer"]


def row(tier: Tier, group: str | None = None) -> BenchPair:
    return BenchPair(Pair(SCAN, SCAN, tier, TRUTH, 0.8), group or tier, TRUTH)


class Oracle:
    """Knows the answer if it is handed it, else says identity."""

    name = "oracle"

    def prepare(self, scan: Scan) -> Scan:
        return scan

    def match_prepared(self, reference: Scan, current: Scan) -> MatchResult:
        return self.match_from(reference, current, Pose.identity())

    def match_from(self, reference: Scan, current: Scan, guess: Pose) -> MatchResult:
        return MatchResult("none", None, None, None, 0.4, "withheld", best=guess)


def absent() -> Any:
    raise ImportError("No module named 'absent'")


def bench(*rows: BenchPair) -> tuple[tuple[BenchRow, ...], tuple[BenchSet, ...]]:
    sets = (BenchSet("a", "real", rows), BenchSet("b", "real", rows[:1]))
    oracle = Contestant("oracle", "peer", Oracle, ("identity", "guess"))
    return run_pair_bench([oracle, Contestant("absent", "peer", absent)], sets), sets


def test_figures_by_group_count_the_best_hypothesis() -> None:
    pairs = [row("far", "low"), row("far", "low"), row("mid", "high"), row("neg")]
    results = [
        MatchResult("none", None, None, None, 0.3, "", best=TRUTH),
        MatchResult("weak", Pose(3.0, 2.0, 0.5), 0.0, None, 0.2, ""),
        MatchResult("match", Pose(9.0, 2.0, 0.5), None, None, 0.1, ""),
        MatchResult("match", TRUTH, None, None, 0.9, ""),
    ]
    found = figures_of(pairs, results, [0.001] * 4, [0.002, 0.002, 0.004, 0.002])
    assert list(found.groups) == ["low", "high", "neg"]
    low = found.groups["low"]
    assert (low.n, low.full, low.full_or_weak, low.confidently_wrong) == (2, 0.5, 1.0, 0.0)
    assert found.groups["high"].confidently_wrong == 1.0
    assert found.confidently_wrong == pytest.approx(0.5)
    assert found.recall_at_zero == 0.0  # the negative has the highest score
    assert (found.match_ms, found.whole_ms) == pytest.approx((2.0, 3.0))
    with pytest.raises(ValueError, match="no pairs"):
        figures_of([], [], [], [])


def test_guesses_are_given_only_where_the_row_says_so() -> None:
    before = threads_may_run_on()
    rows, _ = bench(row("near"), row("mid"), row("neg"))
    identity, guess, missing = rows
    assert (identity.start, guess.start) == ("identity", "guess")
    assert identity.figures["real"].groups["near"].full == 0.0
    assert guess.figures["real"].groups["near"].full == 1.0
    assert guess.figures["real"].groups["near"].n == 2
    assert guess.by_set["b"].groups["near"].n == 1
    assert missing.missing == "No module named 'absent'"
    assert threads_may_run_on() == before
    blind = Contestant("blind", "default", chosen(["lineloom"])[0].make, ("guess",))
    with pytest.raises(TypeError, match="takes no guess"):
        run_pair_bench([blind], (BenchSet("a", "real", (row("near"),)),))


def threads_may_run_on() -> set[int]:
    return os.sched_getaffinity(0) if sys.platform == "linux" else set()


def test_the_table_and_the_json_hold_every_row() -> None:
    rows, sets = bench(row("near"), row("far"), row("mid"), row("neg"))
    text = to_markdown(rows, sets)
    header = next(line for line in text.splitlines() if line.startswith("| matcher"))
    cells = [cell.strip() for cell in header.strip("|").split("|")]
    assert cells[:5] == ["matcher", "start", "near", "mid", "far"]
    assert "absent: not installed (No module named 'absent')" in text
    assert "good guess" in text
    tables = [line for line in text.splitlines() if line.startswith("|")]
    assert len({len(line) for line in tables}) == 1
    figures = json.loads(json.dumps(to_json(rows, sets)))
    assert [s["pairs"] for s in figures["sets"]] == [4, 1]
    assert [m["name"] for m in figures["matchers"]] == ["oracle", "oracle", "absent"]
    assert figures["matchers"][1]["figures"]["real"]["groups"]["far"]["full"] == 1.0


def test_contestants_are_chosen_by_name_and_kind() -> None:
    assert chosen(["peers", "lineloom"])[0].name == "lineloom"
    assert len(chosen(["baselines"])) == 7
    assert chosen(["all"]) == CONTESTANTS
    with pytest.raises(ValueError, match="no matcher 'nobody'"):
        chosen(["nobody"])


@pytest.mark.parametrize("contestant", CONTESTANTS, ids=lambda c: c.name)
def test_contestants_keep_their_word(contestant: Contestant) -> None:
    try:
        matcher = contestant.make()
    except ImportError as error:
        pytest.skip(f"not installed: {error}")
    assert matcher.name == contestant.name
    assert hasattr(matcher, "match_from") == ("guess" in contestant.starts)
    nothing = matcher.prepare(SCAN)
    answer = matcher.match_prepared(nothing, nothing)
    assert (answer.verdict, answer.T_reference_current) == ("none", None)
    assert answer.reason


@pytest.mark.parametrize("contestant", PEERS, ids=lambda c: c.name)
def test_installed_peers_find_a_small_motion_and_repeat_themselves(contestant: Contestant) -> None:
    try:
        matcher = contestant.make()
    except ImportError as error:
        pytest.skip(f"not installed: {error}")
    world, rng = simulated_room(), np.random.default_rng(3)
    here, motion = Pose(2.0, 1.5, 0.4), Pose(0.15, 0.1, 0.1)
    reference = matcher.prepare(scanner_360().scan(world, here, rng))
    current = matcher.prepare(scanner_360().scan(world, here @ motion, rng))
    first = matcher.match_prepared(reference, current)
    assert first.best is not None, first.reason
    assert first.best.distance(motion) < 0.15
    assert 0.0 <= first.score <= 1.0
    assert matcher.match_prepared(reference, current).best == first.best


def simulated_room() -> Any:
    return rectangle(7.0, 4.5).with_walls(
        [(4.0, 0.0, 4.0, 1.2), (4.0, 1.2, 4.8, 1.2), (0.0, 3.0, 0.8, 3.0), (0.8, 3.0, 0.8, 3.6)]
    )


def test_simulated_pairs_fill_every_bin_and_repeat_themselves() -> None:
    sets, again = simulated_sets(2), simulated_sets(2)
    assert [s.name for s in sets] == ["simulated-180", "simulated-360"]
    for one, other in zip(sets, again, strict=True):
        groups = [p.group for p in one.pairs]
        assert groups == [g for g in ("75-100 %", "50-75 %", "25-50 %", "neg") for _ in range(2)]
        for p, q in zip(one.pairs, other.pairs, strict=True):
            np.testing.assert_array_equal(p.pair.reference.ranges, q.pair.reference.ranges)
            assert p.guess == q.guess
            if p.group == "neg":
                assert p.pair.overlap <= 0.05
            else:
                assert p.guess.distance(p.pair.T_ref_cur) <= 0.4
                low, high = (float(v) / 100 for v in p.group.removesuffix(" %").split("-"))
                assert low <= p.pair.overlap <= high


def test_overlap_is_the_share_seen_from_both() -> None:
    world, rng = rectangle(6.0, 4.0), np.random.default_rng(0)
    lidar = scanner_360()
    here = Pose(2.0, 2.0, 0.3)
    scan = lidar.scan(world, here, rng)
    assert overlap_share(scan, scan, Pose.identity()) == 1.0
    there = lidar.scan(world, Pose(4.0, 2.5, -2.0), rng)
    assert overlap_share(scan, there, here.between(Pose(4.0, 2.5, -2.0))) > 0.95
    assert overlap_share(scan, there, Pose(20.0, 0.0, 0.0)) < 0.1


def test_flat_scans_go_to_space_and_back() -> None:
    pose = Pose(0.3, -1.2, 2.5)
    back = from_matrix(to_matrix(pose))
    assert back is not None
    np.testing.assert_allclose(back.to_array(), pose.to_array(), atol=1e-12)
    flipped = np.diag([1.0, -1.0, -1.0, 1.0])
    assert from_matrix(flipped) is None
    assert from_matrix(np.full((4, 4), math.nan)) is None
    assert extruded(np.ones((5, 2)), np.array([0.0, 1.0])).shape == (10, 3)
    scan = scanner_360().scan(rectangle(6.0, 4.0), Pose(2.0, 2.0, 0.3), np.random.default_rng(0))
    thin = usable_points(scan, 0.1)
    assert np.linalg.norm(np.diff(thin, axis=0), axis=1).min() >= 0.1


@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no {SHARED}")
def test_real_pairs_come_with_guesses_and_limits() -> None:
    sets = real_sets(SHARED, limit=3)
    assert [s.name for s in sets] == ["fr079", "mit-csail"]
    for s in sets:
        assert len(s.pairs) == 12
        for p in s.pairs:
            if p.group in ("mid", "far"):
                assert p.guess.distance(p.pair.T_ref_cur) < 0.45


def run(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["bench", "pairs", *arguments])


def test_the_command_reports_as_json(tmp_path: Path) -> None:
    quick = ["--simulated", "2", "--limit", "1", "--from-logs", "0", "--json"]
    result = run("--matchers", "lineloom,complete-lines", *quick)
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)
    assert [m["name"] for m in figures["matchers"]] == ["lineloom", "complete-lines"]
    assert figures["matchers"][0]["figures"]["simulated-360"]["groups"]["neg"]["n"] == 1
    assert "lineloom" in result.stderr


def test_the_command_reports_as_a_table() -> None:
    result = run("--matchers", "complete-lines", "--simulated", "1", "--from-logs", "0")
    assert result.exit_code == 0, result.output
    assert "**simulated-180** (4 pairs)" in result.stdout


def test_the_command_says_what_is_wrong(tmp_path: Path) -> None:
    for arguments, code, told in (
        (["--matchers", "nobody"], 2, "no matcher 'nobody'"),
        (["--data", str(tmp_path)], 1, "holds no files of pairs"),
    ):
        result = run(*arguments)
        assert result.exit_code == code
        assert told in result.stderr.replace("\n", " ")
    np.savez(tmp_path / "other.npz", reference=np.zeros(3))
    assert "is no file of pairs" in run("--data", str(tmp_path)).stderr.replace("\n", " ")


def test_the_command_draws_the_worst_answers(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "worst"
    few = ["--simulated", "2", "--from-logs", "0"]
    result = run("--matchers", "point-to-line", *few, "--worst", str(folder))
    assert result.exit_code == 0, result.output
    assert (folder / "worst-point-to-line-from-identity-simulated-180.png").exists()
