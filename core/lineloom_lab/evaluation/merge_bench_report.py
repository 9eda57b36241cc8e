"""The benchmark of merging as a table for people and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from lineloom_lab.evaluation.merge_bench import CaseResult
from lineloom_lab.evaluation.merge_bench_buildings import UNDECIDABLE
from lineloom_lab.evaluation.merge_bench_overlap import LEAST_SHARED_WAY_M

GOAL_FALSE, GOAL_MADE, GOAL_OFF, GOAL_PAIRS = 0, 0.9, 0, 1000

LEGEND = f"""\
false: robot pairs that were at any time in one map without being rightly joined (relative pose off
by more than 1 m or 15 degrees, or different floors); standing: of these, at the end. due: pairs
that truly saw the same walls along at least {LEAST_SHARED_WAY_M:.0f} m of both ways; made: of
these, rightly joined at the end. off: scans in maps of several robots whose pose is off by more
than 1 m. first: driving time until the first right merge of a fleet, and scans of all its robots
until then (medians over fleets that have a due pair and merged). Worlds that are alike to the last
chair are undecidable: no evidence tells their parts apart, and they do not count."""


@dataclass(frozen=True, slots=True)
class MergeRow:
    """The figures of one building class, or of several together; see `LEGEND`."""

    name: str
    kind: str
    fleets: int
    pairs: int
    false: int
    standing: int
    false_per_1000: float
    due: int
    made: int
    made_share: float | None
    placed: int
    off: int
    first_merge_s: float | None
    first_merge_scans: float | None
    driven_m: float
    map_s: float


def rows_of(results: Sequence[CaseResult]) -> list[MergeRow]:
    """Return a row per class, one of all that count, and those that nobody could decide last."""
    counted = [r for r in results if r.kind != UNDECIDABLE]
    rows = [
        _row(name, [r for r in counted if r.case.building == name])
        for name in dict.fromkeys(r.case.building for r in counted)
    ]
    if counted:
        rows.append(_row("all", counted))
    apart = [r for r in results if r.kind == UNDECIDABLE]
    if apart:
        rows.append(_row(apart[0].case.building, apart))
    return rows


def meets_goal(row: MergeRow) -> bool:
    """Whether figures reach the goal, the number of pairs included."""
    return (
        row.false <= GOAL_FALSE
        and row.off <= GOAL_OFF
        and row.pairs >= GOAL_PAIRS
        and (row.made_share is None or row.made_share >= GOAL_MADE)
    )


def to_json(results: Sequence[CaseResult]) -> dict[str, Any]:
    """Return all figures, and every case with its false and missed pairs, for scripts."""
    return {
        "rows": [asdict(row) for row in rows_of(results)],
        "cases": [_case(result) for result in results],
    }


def to_markdown(results: Sequence[CaseResult]) -> str:
    """Return the table, whether the goal is met, and what the columns mean."""
    header = [
        "buildings", "fleets", "pairs", "false", "standing", "false / 1000", "due", "made",
        "made %", "off > 1 m", "of scans", "first s", "first scans",
    ]  # fmt: skip
    rows = rows_of(results)
    cells = [header, ["---"] + ["---:"] * (len(header) - 1), *(_cells(row) for row in rows)]
    widths = [max(len(line[k]) for line in cells) for k in range(len(header))]
    text = [
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)) + " |"
        for line in cells
    ]
    return "\n".join([*text, "", *_goal(rows), "", LEGEND])


def _goal(rows: Sequence[MergeRow]) -> list[str]:
    whole = next((row for row in rows if row.name == "all"), None)
    if whole is None:
        return []
    wanted = (
        f"{GOAL_FALSE} false merges and {GOAL_OFF} poses off in at least {GOAL_PAIRS} pairs, "
        f"{100 * GOAL_MADE:.0f} % of the due merges made"
    )
    return [f"Goal ({wanted}): {'met' if meets_goal(whole) else 'not met'}."]


def _row(name: str, results: Sequence[CaseResult]) -> MergeRow:
    pairs = sum(r.pairs for r in results)
    false, due = sum(len(r.false) for r in results), sum(len(r.due) for r in results)
    made = sum(len(r.made) for r in results)
    merged = [r for r in results if r.due and r.first_merge_s is not None]
    seconds = [r.first_merge_s for r in merged if r.first_merge_s is not None]
    scans = [r.first_merge_scans for r in merged if r.first_merge_scans is not None]
    return MergeRow(
        name=name,
        kind=results[0].kind if name != "all" else "all",
        fleets=len(results),
        pairs=pairs,
        false=false,
        standing=sum(len(r.standing) for r in results),
        false_per_1000=1000.0 * false / pairs,
        due=due,
        made=made,
        made_share=made / due if due else None,
        placed=sum(r.poses.placed for r in results),
        off=sum(r.poses.off for r in results),
        first_merge_s=median(seconds) if seconds else None,
        first_merge_scans=float(median(scans)) if scans else None,
        driven_m=sum(r.driven_m for r in results),
        map_s=sum(r.map_s for r in results),
    )


def _cells(row: MergeRow) -> list[str]:
    return [
        row.name,
        f"{row.fleets}",
        f"{row.pairs}",
        f"{row.false}",
        f"{row.standing}",
        f"{row.false_per_1000:.1f}",
        f"{row.due}",
        f"{row.made}",
        "" if row.made_share is None else f"{100 * row.made_share:.0f}",
        f"{row.off}",
        f"{row.placed}",
        "" if row.first_merge_s is None else f"{row.first_merge_s:.0f}",
        "" if row.first_merge_scans is None else f"{row.first_merge_scans:.0f}",
    ]


def _case(result: CaseResult) -> dict[str, Any]:
    row = asdict(result)
    del row["case"]["floor_plans"]
    return row
