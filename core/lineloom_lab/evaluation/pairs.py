"""Scan pairs with known relative poses, and what a matcher makes of them.

Four tiers: near (consecutive scans), mid (another pass, < 1.5 m and <= 60 degrees), far (1.5 to
4 m or > 60 degrees) and neg (more than 12 m apart: nothing to be found). An answer is right if it
is off by less than 0.3 m and 5 degrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult, Verdict
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.evaluation.pose_error import pose_error

Tier = Literal["near", "mid", "far", "neg"]

TIERS: tuple[Tier, ...] = ("near", "mid", "far", "neg")
TRANSLATION_LIMIT_M = 0.3
ROTATION_LIMIT_RAD = math.radians(5.0)


@dataclass(frozen=True, slots=True)
class Pair:
    """Two scans and the true T_ref_cur. overlap: share of the current scan seen from both."""

    reference: Scan
    current: Scan
    tier: Tier
    T_ref_cur: Pose
    overlap: float


@dataclass(frozen=True, slots=True)
class PairSet:
    """The pairs of one file, in its order."""

    name: str
    pairs: tuple[Pair, ...]


@dataclass(frozen=True, slots=True)
class TierScore:
    """How a matcher did in one tier; every figure but `n` is a share of its n pairs.

    full: the best hypothesis is right, whatever the verdict. full_or_weak: that, or the verdict is
    "weak" and rotation (< 5 degrees) and position across the weak direction (< 0.3 m) are right.
    match_right: verdict "match", and right. confidently_wrong: verdict "match", and wrong (in the
    neg tier every match is). verdicts: share by verdict.
    """

    n: int
    full: float
    full_or_weak: float
    match_right: float
    confidently_wrong: float
    verdicts: dict[Verdict, float]


@dataclass(frozen=True, slots=True)
class PairScore:
    """How a matcher did over all pairs.

    confidently_wrong: over all tiers, negatives included. recall_at_1_percent, recall_at_zero:
    greatest share of the pairs with something to be found (all but neg) that are accepted with
    their full pose right when everything from some score on is accepted and at most 1 % of the
    wrong answers (none) is accepted with them. A wrong answer is any hypothesis off by more than
    the limits, negatives and slides included.
    """

    tiers: dict[Tier, TierScore]
    confidently_wrong: float
    recall_at_1_percent: float
    recall_at_zero: float


def load_pairs(path: Path | str) -> PairSet:
    """Read a file of pairs (`reference`, `current`, `tier`, `T_ref_cur`, `overlap`, lidar).

    A range of 0 or beyond the sensor's maximum is unknown (NaN), never free space. Raises
    FileNotFoundError where there is no such file, ValueError for one with other contents.
    """
    file = Path(path)
    with np.load(file, allow_pickle=False) as data:
        missing = {"reference", "current", "tier", "T_ref_cur", "overlap"} - set(data.files)
        if missing:
            raise ValueError(f"{file} is no file of pairs: it lacks {', '.join(sorted(missing))}")
        lidar = tuple(float(data[k]) for k in ("angle_min", "angle_increment", "range_max"))
        rows = zip(
            data["reference"].astype(np.float64),
            data["current"].astype(np.float64),
            data["tier"].tolist(),
            data["T_ref_cur"].astype(np.float64),
            data["overlap"].tolist(),
            strict=True,
        )
        pairs = tuple(
            Pair(
                _scan(ref, lidar, 2 * i),
                _scan(cur, lidar, 2 * i + 1),
                _tier(tier),
                Pose.from_array(T),
                overlap,
            )
            for i, (ref, cur, tier, T, overlap) in enumerate(rows)
        )
    return PairSet(file.stem, pairs)


def run_matcher(
    match: Callable[[Scan, Scan], MatchResult], pairs: Sequence[Pair]
) -> tuple[MatchResult, ...]:
    """Return the matcher's answer to every pair, called as match(reference, current)."""
    return tuple(match(pair.reference, pair.current) for pair in pairs)


def score_pairs(pairs: Sequence[Pair], results: Sequence[MatchResult]) -> PairScore:
    """Score the answers, one per pair in the same order. Raises ValueError if counts differ."""
    if len(pairs) != len(results):
        raise ValueError(f"{len(results)} answers to {len(pairs)} pairs")
    right = np.array([is_right(p, r) for p, r in zip(pairs, results, strict=True)], dtype=np.bool_)
    tiers: dict[Tier, TierScore] = {}
    for tier in TIERS:
        chosen = [i for i, p in enumerate(pairs) if p.tier == tier]
        if chosen:
            tiers[tier] = _tier_score([(pairs[i], results[i], bool(right[i])) for i in chosen])
    scores = np.array([r.score for r in results], dtype=np.float64)
    to_find = sum(p.tier != "neg" for p in pairs)
    wrong = sum(t.confidently_wrong * t.n for t in tiers.values())
    return PairScore(
        tiers=tiers,
        confidently_wrong=wrong / len(pairs) if pairs else 0.0,
        recall_at_1_percent=recall_at(scores, right, to_find, 0.01),
        recall_at_zero=recall_at(scores, right, to_find, 0.0),
    )


def is_right(pair: Pair, result: MatchResult) -> bool:
    """Tell whether the best hypothesis is the true pose; never in the neg tier."""
    found = result.best if result.best is not None else result.T_reference_current
    if pair.tier == "neg" or found is None:
        return False
    error = pose_error(found, pair.T_ref_cur)
    return error.translation < TRANSLATION_LIMIT_M and error.rotation < ROTATION_LIMIT_RAD


def is_right_but_for_a_slide(pair: Pair, result: MatchResult) -> bool:
    """Tell whether a "weak" answer is right in all that it claims: rotation and across."""
    if pair.tier == "neg" or result.verdict != "weak":
        return False
    if result.T_reference_current is None or result.weak_direction is None:
        return False
    error = pose_error(result.T_reference_current, pair.T_ref_cur)
    across = error.across(result.weak_direction)
    return across < TRANSLATION_LIMIT_M and error.rotation < ROTATION_LIMIT_RAD


def recall_at(
    scores: NDArray[np.float64], right: NDArray[np.bool_], to_find: int, false_share: float
) -> float:
    """Return the greatest recall at which at most `false_share` of the wrong answers pass.

    scores, right: (n,). to_find: what the accepted right answers are counted against. Equal scores
    are accepted together or not at all.
    """
    allowed = false_share * float(np.count_nonzero(~right)) + 1e-9
    order = np.argsort(-scores, kind="stable")
    true_accepts, false_accepts = np.cumsum(right[order]), np.cumsum(~right[order])
    last_of_its_score = np.append(np.diff(scores[order]) != 0.0, True)[: order.size]
    possible = true_accepts[last_of_its_score & (false_accepts <= allowed)]
    return float(possible.max(initial=0)) / to_find if to_find else 0.0


def _tier_score(rows: Sequence[tuple[Pair, MatchResult, bool]]) -> TierScore:
    n = len(rows)
    matches = [right for _, result, right in rows if result.verdict == "match"]
    verdicts: tuple[Verdict, ...] = ("match", "weak", "ambiguous", "none")
    return TierScore(
        n=n,
        full=sum(right for _, _, right in rows) / n,
        full_or_weak=sum(right or is_right_but_for_a_slide(p, r) for p, r, right in rows) / n,
        match_right=sum(matches) / n,
        confidently_wrong=(len(matches) - sum(matches)) / n,
        verdicts={v: sum(r.verdict == v for _, r, _ in rows) / n for v in verdicts},
    )


def _scan(ranges: NDArray[np.float64], lidar: tuple[float, ...], seq: int) -> Scan:
    angle_min, angle_increment, range_max = lidar
    known = np.where((ranges > 0.0) & (ranges < range_max), ranges, np.nan)
    return Scan.checked(
        known,
        angle_min=angle_min,
        angle_increment=angle_increment,
        range_min=0.0,
        range_max=range_max,
        stamp=float(seq),
        seq=seq,
    )


def _tier(name: str) -> Tier:
    for tier in TIERS:
        if tier == name:
            return tier
    raise ValueError(f"unknown tier {name!r}")
