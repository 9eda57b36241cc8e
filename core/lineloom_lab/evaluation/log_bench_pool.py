"""Several runs of the benchmark of logs as one row of figures.

A share counts every log once, however long it is; counts are sums.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import TypeVar

from lineloom_lab.evaluation.log_bench import LogResult
from lineloom_lab.evaluation.log_bench_judge import LogFigures
from lineloom_lab.evaluation.log_bench_wheels import is_worse

_Row = TypeVar("_Row")

WHOLE_SHARE, WHOLE_WRONG = 0.98, 0.005
"""A log is whole with so many of its scans in one component and so few of its relations wrong."""


@dataclass(frozen=True, slots=True)
class Pool:
    """See `log_bench_report.LEGEND`.

    whole: of the logs, those that became one map without wrong relations, as far as there is a
    reference. ate_rmse [m] is the mean over logs with an independent reference, share_agreeing over
    those with a naive one; shares that need either, over those that have one. None where none
    has. share_same: over runs under another clock. wheels_rmse [m]: likewise of odometry alone;
    worse_than_wheels: logs whose map is more wrong than that, beyond what is allowed.
    """

    logs: int
    whole: int
    share_in_largest: float
    share_unplaced: float
    ate_rmse: float | None
    share_agreeing: float | None
    share_wrong: float | None
    share_relations_wrong: float | None
    share_steps_right: float | None
    share_same: float | None
    wheels_rmse: float | None
    worse_than_wheels: int
    steps_wrong: int
    breaks: int
    cpu_ms: float


def is_whole(figures: LogFigures) -> bool:
    """Whether a log became one map without wrong relations."""
    return figures.share_in_largest >= WHOLE_SHARE and figures.share_relations_wrong <= WHOLE_WRONG


def pooled(results: Sequence[LogResult]) -> Pool:
    """Pool runs that could be read, at least one."""
    figures = [r.figures for r in results if r.figures is not None]
    steps = [r.steps for r in results if r.steps is not None]
    judged = [f for f in figures if f.compared]
    true, naive = (
        [r.figures for r in results if r.figures is not None and r.trust in kinds]
        for kinds in (("reference",), ("pseudo", "doubtful"))
    )
    return Pool(
        logs=len(figures),
        whole=sum(is_whole(f) for f in figures),
        share_in_largest=fmean(f.share_in_largest for f in figures),
        share_unplaced=fmean(f.share_unplaced for f in figures),
        ate_rmse=_mean(true, lambda f: f.ate_rmse),
        share_agreeing=_mean(naive, lambda f: f.share_agreeing),
        share_wrong=_mean(judged, lambda f: f.share_wrong),
        share_relations_wrong=_mean(judged, lambda f: f.share_relations_wrong),
        share_steps_right=_mean(steps, lambda s: s.share_right),
        share_same=_mean(results, lambda r: r.share_same),
        wheels_rmse=_mean(results, lambda r: r.wheels_rmse),
        worse_than_wheels=sum(
            is_worse(r.figures.ate_rmse, r.wheels_rmse) for r in results if r.figures is not None
        ),
        steps_wrong=sum(s.wrong for s in steps),
        breaks=sum(s.breaks for s in steps),
        cpu_ms=fmean(r.cpu_ms for r in results if r.figures is not None),
    )


def _mean(rows: Sequence[_Row], of: Callable[[_Row], float | None]) -> float | None:
    known = [value for row in rows if (value := of(row)) is not None]
    return fmean(known) if known else None
