"""The worst answers of a matcher, drawn: both scans as it laid them, and as they truly lie.

Worst first: wrong answers that say "match", surest first; then other wrong ones by score. Answers
that are right in all but the slide they declare count as right. Each is told by why it failed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult

from lineloom_lab.evaluation.pair_bench_sets import BenchPair
from lineloom_lab.evaluation.pairs import (
    ROTATION_LIMIT_RAD,
    TRANSLATION_LIMIT_M,
    is_right,
    is_right_but_for_a_slide,
)
from lineloom_lab.evaluation.pose_error import pose_error
from lineloom_lab.experiments.figure import Figure, grid
from lineloom_lab.experiments.overlay import overlay
from lineloom_lab.experiments.plan import Plan


@dataclass(frozen=True, eq=False)
class BadAnswer:
    """A wrong answer to pair number `index` of the set `set_name`, and why it is wrong.

    why: "says match", "another place first" (the true pose is among the alternatives), "says weak",
    or "no hypothesis" (nothing near the true pose was found).
    """

    set_name: str
    index: int
    row: BenchPair
    result: MatchResult
    why: str


def bad_answers(
    set_name: str, rows: Sequence[BenchPair], results: Sequence[MatchResult]
) -> list[BadAnswer]:
    """Return the wrong answers to pairs that have a true one, and "match" where there is none."""
    found = []
    for index, (row, result) in enumerate(zip(rows, results, strict=True)):
        confident = result.verdict == "match"
        if is_right(row.pair, result) or is_right_but_for_a_slide(row.pair, result):
            continue
        if row.pair.tier != "neg" or confident:
            found.append(BadAnswer(set_name, index, row, result, _why(row, result)))
    return found


def worst_answers(name: str, bad: Sequence[BadAnswer], most: int = 10) -> Figure | None:
    """Draw the `most` worst, two a row: as answered, as it is. None where nothing is wrong."""
    order = sorted(bad, key=lambda b: (b.result.verdict != "match", -b.result.score))[:most]
    if not order:
        return None
    counts = {why: sum(b.why == why for b in bad) for why in sorted({b.why for b in bad})}
    told = ", ".join(f"{count} {why}" for why, count in counts.items())
    panels = [panel for answer in order for panel in _panels(answer)]
    return Figure(
        name,
        f"The {len(order)} worst of {len(bad)} wrong answers ({told})",
        "Side by side: the scans as the matcher laid them on each other, and as they truly lie.",
        grid(panels, 4),
        300.0,
    )


def _why(row: BenchPair, result: MatchResult) -> str:
    if result.verdict == "match":
        return "says match"
    poses = [a.T_reference_current for a in result.alternatives]
    if row.pair.tier != "neg" and any(_near(pose, row.pair.T_ref_cur) for pose in poses):
        return "another place first"
    return "says weak" if result.verdict == "weak" else "no hypothesis"


def _near(found: Pose, truth: Pose) -> bool:
    error = pose_error(found, truth)
    return error.translation < TRANSLATION_LIMIT_M and error.rotation < ROTATION_LIMIT_RAD


def _panels(answer: BadAnswer) -> list[Plan]:
    pair, result = answer.row.pair, answer.result
    told = f"{answer.set_name} {answer.index}, {answer.row.group}"
    overlap = f"{told}: true pose, overlap {100 * pair.overlap:.0f} %"
    truth = overlay(overlap, pair.reference, pair.current, pair.T_ref_cur)
    pose = result.best or result.T_reference_current
    said = f'"{result.verdict}", score {result.score:.2f}, {answer.why}'
    if pose is None:
        said = f"{said}: no pose at all"
    return [overlay(said, pair.reference, pair.current, pose), truth]
