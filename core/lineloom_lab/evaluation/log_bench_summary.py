"""The benchmark of logs by halves of the buildings: what parameters are chosen with, and the rest.

A half's share counts every log once, however long it is; counts are sums.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean

from lineloom_lab.evaluation.log_bench import LogResult
from lineloom_lab.evaluation.log_bench_cases import Setting
from lineloom_lab.evaluation.log_bench_judge import LogFigures
from lineloom_lab.evaluation.log_bench_log import Half

WHOLE_SHARE, WHOLE_WRONG = 0.98, 0.005
"""A log is whole with so many of its scans in one component and so few of its relations wrong."""


@dataclass(frozen=True, slots=True)
class HalfRow:
    """One half of the buildings under one setting; see `log_bench_report.LEGEND`.

    whole: logs that became one map without wrong relations, as far as there is a reference. The
    shares that need one are means over the logs that have one, None where none has.
    """

    setting: Setting
    half: Half
    logs: int
    whole: int
    share_in_largest: float
    share_unplaced: float
    share_wrong: float | None
    share_relations_wrong: float | None
    share_steps_right: float | None
    steps_wrong: int
    breaks: int
    cpu_ms: float


def is_whole(figures: LogFigures) -> bool:
    """Whether a log became one map without wrong relations."""
    return figures.share_in_largest >= WHOLE_SHARE and figures.share_relations_wrong <= WHOLE_WRONG


def half_rows(results: Sequence[LogResult]) -> list[HalfRow]:
    """Return a row per setting and half, in the order in which they were run; unread logs fall
    out."""
    rows = []
    for setting in dict.fromkeys(result.setting for result in results):
        own = [r for r in results if r.setting == setting and r.figures is not None]
        rows += [
            _row(setting, half, [r for r in own if r.half == half])
            for half in sorted({r.half for r in own}, key=lambda half: (half == "", half))
        ]
    return rows


def _row(setting: Setting, half: Half, results: Sequence[LogResult]) -> HalfRow:
    figures = [r.figures for r in results if r.figures is not None]
    judged = [f for f in figures if f.compared]
    steps = [r.steps for r in results if r.steps is not None]
    right = [s.share_right for s in steps if s.share_right is not None]
    return HalfRow(
        setting=setting,
        half=half,
        logs=len(results),
        whole=sum(is_whole(f) for f in figures),
        share_in_largest=fmean(f.share_in_largest for f in figures),
        share_unplaced=fmean(f.share_unplaced for f in figures),
        share_wrong=_mean(judged, lambda f: f.share_wrong),
        share_relations_wrong=_mean(judged, lambda f: f.share_relations_wrong),
        share_steps_right=fmean(right) if right else None,
        steps_wrong=sum(s.wrong for s in steps),
        breaks=sum(s.breaks for s in steps),
        cpu_ms=fmean(r.cpu_ms for r in results),
    )


def _mean(figures: Sequence[LogFigures], of: Callable[[LogFigures], float]) -> float | None:
    return fmean(of(f) for f in figures) if figures else None
