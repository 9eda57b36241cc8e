"""The benchmark of logs by halves of the buildings: what parameters are chosen with, and the rest.

Settings one below the other, and for every figure a column per half.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from lineloom_lab.evaluation.log_bench import LogResult
from lineloom_lab.evaluation.log_bench_cases import Setting
from lineloom_lab.evaluation.log_bench_log import Half
from lineloom_lab.evaluation.log_bench_pool import Pool, pooled
from lineloom_lab.evaluation.log_bench_table import POOL_COLUMNS, table


def pools_by_half(results: Sequence[LogResult]) -> dict[tuple[Setting, Half], Pool]:
    """Pool the logs of each setting and half, in the order in which they were run, A before B."""
    groups: dict[tuple[Setting, Half], list[LogResult]] = {}
    for setting in dict.fromkeys(result.setting for result in results):
        for result in sorted(results, key=lambda r: (r.half == "", r.half)):
            if result.setting == setting and result.figures is not None:
                groups.setdefault((setting, result.half), []).append(result)
    return {key: pooled(group) for key, group in groups.items()}


def halves_json(results: Sequence[LogResult]) -> list[dict[str, Any]]:
    """Return a row per setting and half."""
    return [
        {**asdict(setting), "half": half, **asdict(pool)}
        for (setting, half), pool in pools_by_half(results).items()
    ]


def halves_table(results: Sequence[LogResult]) -> str:
    """Return the table; empty where no log could be read."""
    pools = pools_by_half(results)
    halves = sorted({half for _, half in pools}, key=lambda half: (half == "", half))
    if not halves:
        return ""
    header = [f"{name} {half or 'others'}" for name in POOL_COLUMNS for half in halves]
    rows = [["setting", *header]]
    for setting in dict.fromkeys(setting for setting, _ in pools):
        found = [pools.get((setting, half)) for half in halves]
        cells = ["" if pool is None else of(pool) for of in POOL_COLUMNS.values() for pool in found]
        rows.append([setting.name, *cells])
    return table(rows, 1)
