"""The worst answers of a matcher, drawn: both scans as it laid them, and as they truly lie.

Worst first: wrong answers that say "match", surest first; then other wrong ones by score. Answers
that are right in all but the slide they declare count as right. Each is told by why it failed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.evaluation.pair_bench_sets import BenchPair
from lineloom_lab.evaluation.pairs import (
    ROTATION_LIMIT_RAD,
    TRANSLATION_LIMIT_M,
    is_right,
    is_right_but_for_a_slide,
)
from lineloom_lab.evaluation.pose_error import pose_error
from lineloom_lab.experiments.figure import Figure, grid
from lineloom_lab.experiments.plan import Bounds, Layer, Plan

REFERENCE_COLOUR = "#1d4ed8"
CURRENT_COLOUR = "#c1121f"
_REACH_M = 7.0
_DOT_M, _HEADING_M = 0.02, 0.8


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
    truth = Plan(
        f"{told}: true pose, overlap {100 * pair.overlap:.0f} %",
        _layers(pair.reference, pair.current, pair.T_ref_cur),
        _around(pair.T_ref_cur),
    )
    pose = result.best or result.T_reference_current
    said = f'"{result.verdict}", score {result.score:.2f}, {answer.why}'
    if pose is None:
        nothing = Layer("reference", _dots(pair.reference.points()), REFERENCE_COLOUR)
        return [Plan(f"{said}: no pose at all", (nothing,), _around(Pose.identity())), truth]
    layers = _layers(pair.reference, pair.current, pose)
    return [Plan(said, layers, _around(pose)), truth]


def _layers(reference: Scan, current: Scan, T_ref_cur: Pose) -> tuple[Layer, ...]:
    seen = T_ref_cur.transform(current.points())
    return (
        Layer("reference", _dots(reference.points()), REFERENCE_COLOUR, 3.0),
        Layer("current", _dots(seen), CURRENT_COLOUR, 3.0, 0.8),
        Layer("", (_arrow(Pose.identity()),), REFERENCE_COLOUR, 4.0),
        Layer("", (_arrow(T_ref_cur),), CURRENT_COLOUR, 4.0),
    )


def _dots(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return each point as a stroke a few centimetres long: layers are lines."""
    half = np.array([_DOT_M, 0.0])
    return tuple(np.array([p - half, p + half]) for p in points)


def _arrow(pose: Pose) -> NDArray[np.float64]:
    """Return where a laser stands and looks, as a polyline."""
    tip = np.array([_HEADING_M, 0.0])
    barbs = [(0.65 * _HEADING_M, side * 0.2 * _HEADING_M) for side in (1.0, -1.0)]
    return pose.transform(np.array([(0.0, 0.0), tip, barbs[0], tip, barbs[1]]))


def _around(pose: Pose) -> Bounds:
    """Return the part of the plane that shows both lasers and what is near them."""
    reach = _REACH_M + 0.25 * math.hypot(pose.x, pose.y)
    x, y = 0.5 * pose.x, 0.5 * pose.y
    return x - 1.3 * reach, y - reach, x + 1.3 * reach, y + reach
