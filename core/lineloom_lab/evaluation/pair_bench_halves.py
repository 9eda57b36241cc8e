"""Pairs of recorded logs by halves of the buildings: what was chosen with one, and the other.

Lidars one below the other, and for every figure a column per half; then the buildings.
"""

from __future__ import annotations

from collections.abc import Sequence

from lineloom_lab.evaluation.log_bench_table import percent, table
from lineloom_lab.evaluation.pair_bench import BenchRow, Figures
from lineloom_lab.evaluation.pair_bench_lidars import AS_RECORDED
from lineloom_lab.evaluation.pair_bench_sets import BenchSet, LogOrigin

_TIERS = ("near", "skip", "mid", "far")


def halves_tables(row: BenchRow, sets: Sequence[BenchSet]) -> str:
    """Return a matcher's tables over pairs of logs; empty where it answered none."""
    found = {s.origin: s.collection for s in sets if s.origin and s.name in row.by_set}
    if not found:
        return ""
    name = row.name + (f" from {row.start}" if row.start != "none" else "")
    return (
        f"**{name}, by lidar and half of the buildings**\n\n{_by_lidar(row, found)}\n\n"
        f"**{name}, by building**\n\n{_by_building(row, sets)}"
    )


def _by_lidar(row: BenchRow, found: dict[LogOrigin, str]) -> str:
    halves = sorted({origin.half for origin in found}, key=lambda half: (half == "", half))
    columns = (*_TIERS, "cw %", "r@1 %", "r@0", "ms whole")
    cells = [["lidar", *(f"{c} {half or 'others'}" for c in columns for half in halves)]]
    for lidar in dict.fromkeys(origin.lidar for origin in found):
        of = {o.half: row.figures[c] for o, c in found.items() if o.lidar == lidar}
        told = {half: _cells(figures) for half, figures in of.items()}
        cells.append([lidar, *(told[h][c] if h in told else "" for c in columns for h in halves)])
    return table(cells, 1)


def _by_building(row: BenchRow, sets: Sequence[BenchSet]) -> str:
    cells = [["building", "half", *_TIERS, "cw %", "r@1 %", "r@0", "ms whole"]]
    for s in sorted(sets, key=lambda s: s.origin.half if s.origin else ""):
        if s.origin and s.origin.lidar == AS_RECORDED:
            told = _cells(row.by_set[s.name])
            cells.append([s.origin.log, s.origin.half, *(told[c] for c in cells[0][2:])])
    return table(cells, 2)


def _cells(figures: Figures) -> dict[str, str]:
    told = {
        "cw %": f"{100.0 * figures.confidently_wrong:.2f}",
        "r@1 %": f"{figures.recall_at_1_percent:.2f}",
        "r@0": f"{figures.recall_at_zero:.2f}",
        "ms whole": f"{figures.whole_ms:.2f}",
    }
    for tier in _TIERS:
        group = figures.groups.get(tier)
        full, weak = (group.full, group.full_or_weak) if group else (None, None)
        told[tier] = percent(full) if full == weak else f"{percent(full)} / {percent(weak)}"
    return told
