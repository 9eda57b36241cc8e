"""The pictures of wrong answers: which are wrong, in which order, and why."""

from __future__ import annotations

from pathlib import Path

from lineloom_core.geometry import Pose
from lineloom_core.matching.result import Alternative, MatchResult, Verdict
from lineloom_core.scan import Scan
from lineloom_lab.evaluation.pair_bench_sets import BenchPair
from lineloom_lab.evaluation.pairs import Pair, Tier
from lineloom_lab.experiments.worst_answers import bad_answers, worst_answers

TRUTH = Pose(1.0, 2.0, 0.5)
WRONG = Pose(1.0, 3.0, 0.5)
SCAN = Scan.checked(
    [1.0, 2.0, 2.0], angle_min=0.0, angle_increment=0.1, range_min=0.0, range_max=9.0, stamp=0.0
)


def row(tier: Tier) -> BenchPair:
    return BenchPair(Pair(SCAN, SCAN, tier, TRUTH, 0.8), tier, TRUTH)


def answer(verdict: Verdict, best: Pose | None, score: float, *others: Pose) -> MatchResult:
    stands = best if verdict != "none" else None
    alternatives = tuple(Alternative(pose, 0.1) for pose in others)
    direction = 0.0 if verdict == "weak" else None
    return MatchResult(
        verdict, stands, direction, None, score, "", best=best, alternatives=alternatives
    )


def test_wrong_answers_are_told_apart_by_why_they_are_wrong() -> None:
    asked: list[tuple[Tier, MatchResult]] = [
        ("far", answer("match", TRUTH, 0.9)),
        ("far", answer("match", WRONG, 0.8)),
        ("far", answer("ambiguous", WRONG, 0.7, TRUTH)),
        ("far", answer("weak", WRONG, 0.6)),
        ("far", answer("weak", Pose(9.0, 2.0, 0.5), 0.6)),
        ("far", answer("none", None, 0.0)),
        ("neg", answer("weak", WRONG, 0.5)),
        ("neg", answer("match", WRONG, 0.4)),
    ]
    bad = bad_answers("a", [row(tier) for tier, _ in asked], [result for _, result in asked])
    assert [(b.index, b.why) for b in bad] == [
        (1, "says match"),
        (2, "another place first"),
        (3, "says weak"),
        (5, "no hypothesis"),
        (7, "says match"),
    ]


def test_confident_ones_are_drawn_first(tmp_path: Path) -> None:
    rows = [row("far")] * 3
    results = [
        answer("none", None, 0.0),
        answer("ambiguous", WRONG, 0.9),
        answer("match", WRONG, 0.8),
    ]
    figure = worst_answers("worst", bad_answers("a", rows, results), most=2)
    assert figure is not None
    drawn = figure.save(tmp_path)[0].read_text(encoding="utf-8")
    assert "The 2 worst of 3 wrong answers" in drawn
    assert 0 < drawn.index(", says match<") < drawn.index("score 0.90")
    assert "no pose at all" not in drawn
    assert (tmp_path / "worst.png").stat().st_size > 1000


def test_nothing_wrong_is_nothing_to_draw() -> None:
    assert (
        worst_answers("worst", bad_answers("a", [row("far")], [answer("match", TRUTH, 1)])) is None
    )
