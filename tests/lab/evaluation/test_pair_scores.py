"""The scorer on answers whose marks are known, and the loader on the real files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult, Verdict
from lineloom_core.scan import Scan
from lineloom_lab.evaluation import Pair, load_pairs, run_matcher, score_pairs
from lineloom_lab.evaluation.pairs import Tier, recall_at

SHARED = Path(__file__).parents[4] / "shared" / "data" / "pairs"
SCAN = Scan.checked(
    [1.0, 2.0], angle_min=0.0, angle_increment=0.1, range_min=0.0, range_max=9.0, stamp=0.0
)


def pair(tier: Tier) -> Pair:
    return Pair(SCAN, SCAN, tier, Pose(1.0, 2.0, 0.5), 0.8)


def answer(
    verdict: Verdict, dx: float, score: float, dtheta: float = 0.0, weak: float | None = None
) -> MatchResult:
    return MatchResult(verdict, Pose(1.0 + dx, 2.0, 0.5 + dtheta), weak, None, score, "")


NONE = MatchResult("none", None, None, None, 0.0, "nothing fits")


def test_every_kind_of_answer_gets_its_mark() -> None:
    pairs = [pair("far")] * 6 + [pair("neg")] * 2
    results = [
        answer("match", 0.1, 0.9),
        answer("match", 0.5, 0.3),  # confidently wrong
        answer("weak", 2.0, 0.1, weak=0.0),  # a slide that is owned up to
        answer("weak", 2.0, 0.1, weak=math.pi / 2),  # the wrong way
        answer("ambiguous", 0.2, 0.6),
        NONE,
        answer("match", 0.0, 0.2),  # a match of two different places
        NONE,
    ]
    score = score_pairs(pairs, results)
    far, neg = score.tiers["far"], score.tiers["neg"]
    assert list(score.tiers) == ["far", "neg"]
    assert far.n == 6
    assert far.full == pytest.approx(2 / 6)
    assert far.full_or_weak == pytest.approx(3 / 6)
    assert far.match_right == pytest.approx(1 / 6)
    assert far.confidently_wrong == pytest.approx(1 / 6)
    assert far.verdicts["none"] == pytest.approx(1 / 6)
    assert neg.full == 0.0
    assert neg.confidently_wrong == pytest.approx(0.5)
    assert score.confidently_wrong == pytest.approx(2 / 8)
    assert score.recall_at_zero == pytest.approx(2 / 6)


def test_the_limits_are_those_of_the_data() -> None:
    def full(dx: float, dtheta: float) -> float:
        result = score_pairs([pair("mid")], [answer("match", dx, 1.0, dtheta)])
        return result.tiers["mid"].full

    assert full(0.29, math.radians(4.9)) == 1.0
    assert full(0.31, 0.0) == 0.0
    assert full(0.0, math.radians(5.1)) == 0.0


def test_recall_against_all_thresholds_by_hand() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        scores = rng.integers(0, 12, 60) / 12.0  # many ties
        right = rng.random(60) < 0.3 + 0.6 * scores
        for share in (0.0, 0.05, 0.3):
            best = 0.0
            for threshold in [*np.unique(scores), 2.0]:
                accepted = scores >= threshold
                if (accepted & ~right).sum() <= share * (~right).sum():
                    best = max(best, (accepted & right).sum() / 80)
            assert recall_at(scores, right, 80, share) == pytest.approx(best)
    assert recall_at(np.zeros(0), np.zeros(0, dtype=bool), 5, 0.01) == 0.0


def test_counts_must_agree() -> None:
    with pytest.raises(ValueError, match="1 answers to 2 pairs"):
        score_pairs([pair("near")] * 2, [NONE])


def test_a_file_of_something_else_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match="T_ref_cur"):
        load_pairs(tmp_path / "x.npz")


@pytest.mark.skipif(not SHARED.exists(), reason=f"needs {SHARED}")
@pytest.mark.parametrize("name", ["fr079", "mit-csail"])
def test_real_pairs_are_read_whole(name: str) -> None:
    loaded = load_pairs(SHARED / f"{name}.npz")
    assert loaded.name == name
    assert len(loaded.pairs) == 400
    for tier in ("near", "mid", "far", "neg"):
        assert sum(p.tier == tier for p in loaded.pairs) == 100
    for p in loaded.pairs:
        assert not np.isinf(p.reference.ranges).any()
        assert np.nanmax(p.current.ranges) < p.current.range_max
        assert (p.T_ref_cur.distance(Pose.identity()) > 12.0) == (p.tier == "neg")


@pytest.mark.skipif(not SHARED.exists(), reason=f"needs {SHARED}")
def test_the_truth_fits_the_scans() -> None:
    """Points of the current scan, carried over, lie on the reference's: the frames are right."""
    for p in load_pairs(SHARED / "fr079.npz").pairs:
        if p.tier != "near":
            continue
        there, here = p.reference.points(), p.T_ref_cur.transform(p.current.points())
        nearest = np.min(np.linalg.norm(here[:, None] - there[None], axis=2), axis=1)
        assert np.median(nearest) < 0.15


@pytest.mark.skipif(not SHARED.exists(), reason=f"needs {SHARED}")
def test_an_oracle_gets_full_marks() -> None:
    pairs = load_pairs(SHARED / "mit-csail.npz").pairs
    truth = {id(p.current): p for p in pairs}

    def oracle(reference: Scan, current: Scan) -> MatchResult:
        p = truth[id(current)]
        if p.tier == "neg":
            return NONE
        return MatchResult("match", p.T_ref_cur, None, None, p.overlap, "")

    score = score_pairs(pairs, run_matcher(oracle, pairs))
    assert all(score.tiers[t].full == 1.0 for t in ("near", "mid", "far"))
    assert score.confidently_wrong == 0.0
    assert score.recall_at_zero == 1.0
    assert score.recall_at_1_percent == 1.0
