"""The benchmark of logs as a table for people and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from lineloom_lab.evaluation.log_bench import LogResult
from lineloom_lab.evaluation.log_bench_halves import halves_json, halves_table
from lineloom_lab.evaluation.log_bench_judge import AGREE_M, AGREE_RAD, RELATION_WAY_M, WRONG_M
from lineloom_lab.evaluation.log_bench_pool import WHOLE_SHARE, WHOLE_WRONG
from lineloom_lab.evaluation.log_bench_sameness import SAME_M
from lineloom_lab.evaluation.log_bench_steps import STEP_M, STEP_RAD
from lineloom_lab.evaluation.log_bench_table import metres, percent, table
from lineloom_lab.evaluation.log_bench_wheels import WORSE_M, WORSE_SHARE

_DEGREES, _STEP_DEGREES = math.degrees(AGREE_RAD), math.degrees(STEP_RAD)

LEGEND = f"""\
- in largest: share of the scans (of those with a reference, where there is one) in the component
  that has most. unplaced: scans in none. robots: that have a scan in the largest.
- ATE: rms of the positions in the largest after alignment, against an independent reference.
  wheels: of the odometry alone, where it was sent; worse: maps off by more than that plus
  {100 * WORSE_SHARE:.0f} % and {WORSE_M:g} m.
- agree: share of the scans within {AGREE_M:g} m and {_DEGREES:.0f} degrees of a naive search
  without loops, with "?" where that is itself unsure. Of lidars on one robot: where two are in one
  component, the share that lies as they are mounted.
- wrong: scans off by more than {WRONG_M:g} m in their component. relations: of a robot's scans 1 to
  16 apart and up to {RELATION_WAY_M:.0f} m of way, the share off by more than {WRONG_M:g} m.
- steps right: from one scan to the next in one component, the share within {STEP_M:g} m and
  {_STEP_DEGREES:.0f} degrees; wrong steps: the others. breaks: steps that the map does not make.
- same: of what the same run under the true clock placed, the share within {100 * SAME_M:.0f} cm.
- CPU: mapping, ms a scan.
- one map: logs with {100 * WHOLE_SHARE:.0f} % of their scans in the largest and at most
  {100 * WHOLE_WRONG:g} % of the relations wrong. Of several logs, ATE and shares are means, counts
  are sums.
"""

_HEADER = [
    "log", "half", "setting", "scans", "components", "in largest %", "unplaced %", "ATE m",
    "wheels m", "agree %", "wrong %", "relations %", "robots", "steps right %", "same %",
    "wrong steps", "breaks", "CPU ms",
]  # fmt: skip


def to_json(results: Sequence[LogResult]) -> dict[str, Any]:
    """Return all figures for scripts: a row per run, and the halves of the buildings."""
    return {"rows": rows_json(results), "halves": halves_json(results)}


def rows_json(results: Sequence[LogResult]) -> list[dict[str, Any]]:
    """Return a row per run: how it was run, all figures, and shares made of them."""
    return [_row(result) for result in results]


def to_markdown(results: Sequence[LogResult]) -> str:
    """Return the runs, the halves of the buildings side by side, and what the columns mean."""
    runs = table([_HEADER, *(_cells(result) for result in results)], 3)
    unreadable = {f"{r.log}: {r.unreadable}" for r in results if r.unreadable is not None}
    parts = [runs, halves_table(results), *sorted(unreadable), LEGEND]
    return "\n\n".join(part for part in parts if part)


def _row(result: LogResult) -> dict[str, Any]:
    figures, steps = result.figures, result.steps
    row: dict[str, Any] = {
        "log": result.log,
        "half": result.half,
        **asdict(result.setting),
        "trust": result.trust,
        "cpu_ms": result.cpu_ms,
        "share_same": result.share_same,
        "share_rigid": result.share_rigid,
        "wheels_rmse": result.wheels_rmse,
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
    agree = percent(result.share_rigid if blind else None if sure else figures.share_agreeing)
    return [
        *head,
        f"{figures.scans}",
        f"{figures.components}",
        percent(figures.share_in_largest),
        percent(figures.share_unplaced),
        metres(figures.ate_rmse) if sure else "",
        metres(result.wheels_rmse),
        agree + ("?" if result.trust == "doubtful" else ""),
        "" if blind else percent(figures.share_wrong),
        "" if blind else percent(figures.share_relations_wrong),
        f"{figures.in_largest} of {figures.robots}",
        "" if blind else percent(steps.share_right),
        percent(result.share_same),
        "" if blind else f"{steps.wrong}",
        f"{steps.breaks}",
        f"{result.cpu_ms:.2f}",
    ]
