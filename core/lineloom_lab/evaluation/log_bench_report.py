"""The benchmark of logs as a table for people and as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from lineloom_lab.evaluation.log_bench import LogResult
from lineloom_lab.evaluation.log_bench_judge import AGREE_M, AGREE_RAD, RELATION_WAY_M, WRONG_M
from lineloom_lab.evaluation.log_bench_steps import STEP_M, STEP_RAD
from lineloom_lab.evaluation.log_bench_summary import (
    WHOLE_SHARE,
    WHOLE_WRONG,
    HalfRow,
    half_rows,
)

LEGEND = f"""\
components, in largest: pieces of the map, and the share of scans (of those with a reference, where
there is one) in the one with most. unplaced: scans in none. ATE: rms of the positions in the
largest after alignment, against an independent reference. agree: against a naive search without
loops, share of its scans within {AGREE_M:g} m and {math.degrees(AGREE_RAD):.0f} degrees; "?": it is
itself unsure. wrong: scans off by more than {WRONG_M:g} m in their component. relations: of a
robot's scans 1 to 16 apart and up to {RELATION_WAY_M:.0f} m of way, the share off by more than
{WRONG_M:g} m. robots: with a scan in the largest, of all. steps: from one scan to the next in one
component, the share within {STEP_M:g} m and {math.degrees(STEP_RAD):.0f} degrees, and how many are
not; breaks: steps that the map does not make. CPU: mapping, ms a scan. By halves of the buildings:
one map: logs with {100 * WHOLE_SHARE:.0f} % of their scans in the largest and at most
{100 * WHOLE_WRONG:g} % of the relations wrong; shares are means over logs, counts are sums."""

_HEADER = [
    "log", "half", "setting", "scans", "components", "in largest %", "unplaced %", "ATE m",
    "agree %", "wrong %", "relations %", "robots", "steps right %", "wrong steps", "breaks",
    "CPU ms",
]  # fmt: skip


def to_json(results: Sequence[LogResult]) -> dict[str, Any]:
    """Return all figures for scripts: a row per run, and the halves of the buildings."""
    return {
        "rows": [_row(result) for result in results],
        "halves": [asdict(row) for row in half_rows(results)],
    }


def to_markdown(results: Sequence[LogResult]) -> str:
    """Return the runs, the halves of the buildings side by side, and what the columns mean."""
    runs = [_HEADER, *(_cells(result) for result in results)]
    unreadable = {f"{r.log}: {r.unreadable}" for r in results if r.unreadable is not None}
    parts = [_table(runs, 3), *_halves(half_rows(results)), *sorted(unreadable), LEGEND]
    return "\n\n".join(parts)


def _halves(rows: Sequence[HalfRow]) -> list[str]:
    """Return a table with a row per setting, and for every figure a column per half."""
    halves = list(dict.fromkeys(row.half for row in rows))
    if not halves:
        return []
    by = {(row.setting, row.half): row for row in rows}
    header = [f"{name} {half or 'others'}" for name in _SUMMARY for half in halves]
    cells = [["setting", *header]]
    for setting in dict.fromkeys(row.setting for row in rows):
        found = [by.get((setting, half)) for half in halves]
        figures = [of(row) if row else "" for of in _SUMMARY.values() for row in found]
        cells.append([setting.name, *figures])
    return [_table(cells, 1)]


def _row(result: LogResult) -> dict[str, Any]:
    figures, steps = result.figures, result.steps
    row: dict[str, Any] = {
        "log": result.log,
        "half": result.half,
        **asdict(result.setting),
        "trust": result.trust,
        "cpu_ms": result.cpu_ms,
        "unreadable": result.unreadable,
    }
    if figures is None or steps is None:
        return row
    shares = {
        "share_in_largest": figures.share_in_largest,
        "share_unplaced": figures.share_unplaced,
        "share_agreeing": figures.share_agreeing,
        "share_wrong": figures.share_wrong,
        "share_relations_wrong": figures.share_relations_wrong,
        "share_steps_right": steps.share_right,
    }
    counts = asdict(steps)
    return row | asdict(figures) | counts | {"steps_wrong": steps.wrong} | shares


def _cells(result: LogResult) -> list[str]:
    head = [result.log, result.half, result.setting.name]
    figures, steps = result.figures, result.steps
    if figures is None or steps is None:
        return [*head, "unreadable", *[""] * (len(_HEADER) - len(head) - 1)]
    blind, sure = result.trust == "none", result.trust == "reference"
    agree = "" if blind or sure else _percent(figures.share_agreeing)
    return [
        *head,
        f"{figures.scans}",
        f"{figures.components}",
        _percent(figures.share_in_largest),
        _percent(figures.share_unplaced),
        f"{figures.ate_rmse:.3f}" if sure and figures.ate_rmse is not None else "",
        agree + ("?" if result.trust == "doubtful" else ""),
        "" if blind else _percent(figures.share_wrong),
        "" if blind else _percent(figures.share_relations_wrong),
        f"{figures.in_largest} of {figures.robots}",
        "" if blind else _percent(steps.share_right),
        "" if blind else f"{steps.wrong}",
        f"{steps.breaks}",
        f"{result.cpu_ms:.2f}",
    ]


def _table(cells: Sequence[Sequence[str]], names: int) -> str:
    """Set a table whose first `names` columns are text."""
    rule = ["---"] * names + ["---:"] * (len(cells[0]) - names)
    lines = [cells[0], rule, *cells[1:]]
    widths = [max(len(line[k]) for line in lines) for k in range(len(rule))]
    return "\n".join(
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)) + " |"
        for line in lines
    )


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100.0 * share:.1f}"


_SUMMARY: dict[str, Callable[[HalfRow], str]] = {
    "one map": lambda row: f"{row.whole} of {row.logs}",
    "in largest %": lambda row: _percent(row.share_in_largest),
    "unplaced %": lambda row: _percent(row.share_unplaced),
    "wrong %": lambda row: _percent(row.share_wrong),
    "relations %": lambda row: _percent(row.share_relations_wrong),
    "steps right %": lambda row: _percent(row.share_steps_right),
    "wrong steps": lambda row: f"{row.steps_wrong}",
    "breaks": lambda row: f"{row.breaks}",
    "CPU ms": lambda row: f"{row.cpu_ms:.2f}",
}
