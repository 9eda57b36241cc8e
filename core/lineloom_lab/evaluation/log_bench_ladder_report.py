"""The ladders as a table for people and as JSON: a row per rung, of all its buildings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from lineloom_lab.evaluation.log_bench import LogResult
from lineloom_lab.evaluation.log_bench_cases import Setting
from lineloom_lab.evaluation.log_bench_ladders import Rung
from lineloom_lab.evaluation.log_bench_pool import Pool, pooled
from lineloom_lab.evaluation.log_bench_report import LEGEND, rows_json
from lineloom_lab.evaluation.log_bench_table import POOL_COLUMNS, table

RungResults = Sequence[tuple[Rung, LogResult]]


def ladders_json(results: RungResults) -> dict[str, Any]:
    """Return all figures for scripts: a row per run, and one per rung."""
    return {
        "rows": rows_json([result for _, result in results]),
        "rungs": [
            {"ladder": rung.ladder, "value": rung.value, **asdict(setting), **asdict(pool)}
            for (rung, setting), pool in _pools(results).items()
        ],
    }


def ladders_markdown(results: RungResults) -> str:
    """Return a table of all rungs, and what the columns mean."""
    # Truth is known and clocks are true: nothing is held against a naive search or another clock.
    columns = {n: of for n, of in POOL_COLUMNS.items() if n not in ("agree %", "same %")}
    rows = [["rung", "setting", *columns]]
    for (rung, setting), pool in _pools(results).items():
        rows.append([rung.name, setting.name, *(of(pool) for of in columns.values())])
    return f"{table(rows, 2)}\n\n{LEGEND}"


def _pools(results: RungResults) -> Mapping[tuple[Rung, Setting], Pool]:
    groups: dict[tuple[Rung, Setting], list[LogResult]] = {}
    for rung, result in results:
        groups.setdefault((rung, result.setting), []).append(result)
    return {key: pooled(group) for key, group in groups.items()}
