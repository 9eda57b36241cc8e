"""One benchmark of pairwise matchers: how often right, how sure, how fast.

Every matcher sees the same pairs. What counts as right is told in `evaluation.pairs`; the best
hypothesis counts whatever the verdict, for it is what the score speaks of. Times are the process's
CPU time (all threads of it) on one core, so that other people on the machine show little.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from lineloom_core.matching import Matcher
from lineloom_core.matching.result import MatchResult

from lineloom_lab.evaluation.pair_bench_contestants import (
    Contestant,
    GuidedMatcher,
    Kind,
    Start,
)
from lineloom_lab.evaluation.pair_bench_sets import BenchPair, BenchSet
from lineloom_lab.evaluation.pairs import is_right, is_right_but_for_a_slide, score_pairs


@dataclass(frozen=True, slots=True)
class GroupFigures:
    """Shares of the n pairs of one tier or overlap bin.

    full: the best hypothesis is right. full_or_weak: that, or right in all but the slide that a
    "weak" verdict declares. confidently_wrong: verdict "match", and wrong.
    """

    n: int
    full: float
    full_or_weak: float
    confidently_wrong: float


@dataclass(frozen=True, slots=True)
class Figures:
    """What a matcher did on one collection of pairs.

    groups: by tier or overlap bin, in order. confidently_wrong: share of all pairs. recall_*: see
    `PairScore`. match_ms: median CPU time of a pair whose scans are prepared; whole_ms: with the
    preparation of both scans [ms].
    """

    groups: dict[str, GroupFigures]
    confidently_wrong: float
    recall_at_1_percent: float
    recall_at_zero: float
    match_ms: float
    whole_ms: float


@dataclass(frozen=True, slots=True)
class BenchRow:
    """One matcher: its figures by collection and by set, or why there are none (`missing`)."""

    name: str
    kind: Kind
    start: Start
    figures: dict[str, Figures]
    by_set: dict[str, Figures]
    missing: str = ""


@dataclass(frozen=True, slots=True)
class _Answer:
    row: BenchPair
    result: MatchResult
    prepare_s: float
    match_s: float


OnAnswers = Callable[[str, BenchSet, Sequence[MatchResult]], None]
"""Called with who answered, the set, and an answer per pair."""


def run_pair_bench(
    contestants: Iterable[Contestant],
    sets: Sequence[BenchSet],
    on_progress: Callable[[str], None] = lambda _: None,
    on_answers: OnAnswers = lambda *_: None,
) -> tuple[BenchRow, ...]:
    """Run every contestant over every set, from each of its starts; tell who is at work."""
    with _one_core():
        return tuple(row for c in contestants for row in _run_one(c, sets, on_progress, on_answers))


@contextmanager
def _one_core() -> Iterator[None]:
    """Keep this process on one core where the system can, and let it go again.

    Open3D's thread pool draws its samples in another order each time it has two cores, seeded or
    not: on one core it repeats itself.
    """
    if sys.platform != "linux":
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def figures_of(
    pairs: Sequence[BenchPair],
    results: Sequence[MatchResult],
    prepare_s: Sequence[float],
    match_s: Sequence[float],
) -> Figures:
    """Judge the answers to pairs; times in seconds, one per pair. Raises ValueError for none."""
    if not pairs:
        raise ValueError("there are no pairs to judge")
    judged = [_with_best(result) for result in results]
    whole = score_pairs([row.pair for row in pairs], judged)
    groups = {
        group: _group([(p, r) for p, r in zip(pairs, judged, strict=True) if p.group == group])
        for group in dict.fromkeys(row.group for row in pairs)
    }
    return Figures(
        groups=groups,
        confidently_wrong=whole.confidently_wrong,
        recall_at_1_percent=whole.recall_at_1_percent,
        recall_at_zero=whole.recall_at_zero,
        match_ms=1e3 * float(np.median(match_s)),
        whole_ms=1e3 * float(np.median(np.add(prepare_s, match_s))),
    )


def _run_one(
    contestant: Contestant,
    sets: Sequence[BenchSet],
    on_progress: Callable[[str], None],
    on_answers: OnAnswers,
) -> Iterator[BenchRow]:
    try:
        matcher = contestant.make()
    except ImportError as error:
        for start in contestant.starts:
            yield BenchRow(contestant.name, contestant.kind, start, {}, {}, str(error))
        return
    for start in contestant.starts:
        label = contestant.name + (f" from {start}" if start != "none" else "")
        on_progress(label)
        by_set = {s.name: _answers(matcher, start, s) for s in sets}
        for s in sets:
            on_answers(label, s, [a.result for a in by_set[s.name]])
        yield _row(contestant, start, sets, by_set)


def _answers(matcher: Matcher[Any], start: Start, pairs: BenchSet) -> list[_Answer]:
    return [_answer(matcher, start, row) for row in _warmed(pairs.pairs)][1:]


def _row(
    contestant: Contestant,
    start: Start,
    sets: Sequence[BenchSet],
    by_set: Mapping[str, list[_Answer]],
) -> BenchRow:
    collections: dict[str, list[_Answer]] = {}
    for s in sets:
        collections.setdefault(s.collection, []).extend(by_set[s.name])
    return BenchRow(
        contestant.name,
        contestant.kind,
        start,
        {name: _figures(answers) for name, answers in collections.items()},
        {name: _figures(answers) for name, answers in by_set.items()},
    )


def _warmed(pairs: Sequence[BenchPair]) -> Iterable[BenchPair]:
    """The first pair twice: compilers and caches have their turn before the clock counts."""
    return (*pairs[:1], *pairs)


def _answer(matcher: Matcher[Any], start: Start, row: BenchPair) -> _Answer:
    begin = time.process_time()
    reference, current = matcher.prepare(row.pair.reference), matcher.prepare(row.pair.current)
    prepared = time.process_time()
    if start == "guess":
        if not isinstance(matcher, GuidedMatcher):
            raise TypeError(f"{matcher.name} takes no guess")
        result = matcher.match_from(reference, current, row.guess)
    else:
        result = matcher.match_prepared(reference, current)
    end = time.process_time()
    return _Answer(row, result, prepared - begin, end - prepared)


def _figures(answers: Sequence[_Answer]) -> Figures:
    return figures_of(
        [a.row for a in answers],
        [a.result for a in answers],
        [a.prepare_s for a in answers],
        [a.match_s for a in answers],
    )


def _with_best(result: MatchResult) -> MatchResult:
    """Let the best hypothesis stand where the verdict withholds it, with the verdict kept."""
    if result.T_reference_current is None and result.best is not None:
        return replace(result, T_reference_current=result.best)
    return result


def _group(rows: Sequence[tuple[BenchPair, MatchResult]]) -> GroupFigures:
    right = [is_right(row.pair, result) for row, result in rows]
    slides = [is_right_but_for_a_slide(row.pair, result) for row, result in rows]
    matches = [result.verdict == "match" for _, result in rows]
    n = len(rows)
    return GroupFigures(
        n=n,
        full=sum(right) / n,
        full_or_weak=sum(a or b for a, b in zip(right, slides, strict=True)) / n,
        confidently_wrong=sum(m and not r for m, r in zip(matches, right, strict=True)) / n,
    )
