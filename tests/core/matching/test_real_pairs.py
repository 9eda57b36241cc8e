"""The default matcher on real scan pairs: one measure, the same as the benchmark's."""

from __future__ import annotations

from pathlib import Path

import pytest
from lineloom_core.matching import LineMatcher
from lineloom_lab.evaluation import Pair, load_pairs, run_matcher, score_pairs

FOLDER = Path(__file__).parents[4] / "shared" / "data" / "pairs"
FILES = ("fr079.npz", "mit-csail.npz")


@pytest.fixture(scope="module")
def pairs() -> list[Pair]:
    if not FOLDER.is_dir():
        pytest.skip(f"no folder {FOLDER}: it holds the real scan pairs")
    return [pair for name in FILES for pair in load_pairs(FOLDER / name).pairs]


def test_real_pairs_are_matched_and_hardly_ever_wrongly(pairs: list[Pair]) -> None:
    score = score_pairs(pairs, run_matcher(LineMatcher().match, pairs))
    assert score.tiers["near"].full >= 0.98
    assert score.tiers["mid"].full >= 0.95
    assert score.tiers["far"].full_or_weak >= 0.55
    assert score.confidently_wrong <= 0.01
    assert score.recall_at_1_percent >= 0.7
