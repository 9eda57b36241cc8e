"""The benchmark of pairwise matchers as a table for people and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from lineloom_lab.evaluation.pair_bench import BenchRow, Figures
from lineloom_lab.evaluation.pair_bench_halves import halves_tables
from lineloom_lab.evaluation.pair_bench_sets import BenchSet
from lineloom_lab.evaluation.pairs import TIERS

LEGEND = """\
Tiers and overlap bins: full pose right (< 0.3 m, < 5 degrees), in percent; after the slash also
counting answers that are right in all but the slide they declare. cw: says "match" and is wrong, in
percent of all pairs, negatives included. r@1 %, r@0: recall at 1 % and at no false positives, by
the matcher's own score. ms: median CPU time of a pair, scans prepared / with both extractions.
Pairs of logs: near is consecutive, skip with one scan between, mid and far from another time.
A start from a good guess (up to 0.4 m, 10 degrees off) is help that the others do not get."""


def to_json(rows: Sequence[BenchRow], sets: Sequence[BenchSet]) -> dict[str, Any]:
    """Return all figures for scripts: shares 0..1, times in milliseconds."""
    return {
        "sets": [
            {
                "name": s.name,
                "collection": s.collection,
                "pairs": len(s.pairs),
                "half": s.origin.half if s.origin else "",
            }
            for s in sets
        ],
        "matchers": [asdict(row) for row in rows],
    }


def to_markdown(rows: Sequence[BenchRow], sets: Sequence[BenchSet]) -> str:
    """Return one table per collection, and what the columns mean."""
    by_tier = dict.fromkeys(s.collection for s in sets if s.origin is None)
    parts = [_table(collection, rows, sets) for collection in by_tier]
    parts += [text for row in rows if (text := halves_tables(row, sets))]
    absent = {row.name: row.missing for row in rows if row.missing}
    if absent:
        parts.append("\n".join(f"{name}: not installed ({why})" for name, why in absent.items()))
    return "\n\n".join([*parts, LEGEND])


def _table(collection: str, rows: Sequence[BenchRow], sets: Sequence[BenchSet]) -> str:
    pairs = [row for s in sets if s.collection == collection for row in s.pairs]
    found = dict.fromkeys(row.group for row in pairs if row.group != "neg")
    groups = sorted(found, key=lambda group: TIERS.index(group) if group in TIERS else 0)
    names = [s.name for s in sets if s.collection == collection]
    title = collection if names == [collection] else f"{collection}: {', '.join(names)}"
    header = ["matcher", "start", *groups, "cw %", "r@1 %", "r@0", "ms", "ms whole"]
    lines = [header, ["---", "---"] + ["---:"] * (len(header) - 2)]
    for row in rows:
        figures = row.figures.get(collection)
        start = {"none": "", "identity": "identity", "guess": "good guess"}[row.start]
        cells = _cells(figures, groups) if figures else ["not installed"] + [""] * (len(groups) + 4)
        lines.append([row.name, start, *cells])
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]
    text = [
        "| " + " | ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)) + " |"
        for line in lines
    ]
    return "\n".join([f"**{title}** ({len(pairs)} pairs)", "", *text])


def _cells(figures: Figures, groups: Sequence[str]) -> list[str]:
    shares = []
    for group in groups:
        found = figures.groups[group]
        full, weak = f"{100 * found.full:.1f}", f"{100 * found.full_or_weak:.1f}"
        shares.append(full if full == weak else f"{full} / {weak}")
    return [
        *shares,
        f"{100 * figures.confidently_wrong:.1f}",
        f"{figures.recall_at_1_percent:.2f}",
        f"{figures.recall_at_zero:.2f}",
        f"{figures.match_ms:.2f}",
        f"{figures.whole_ms:.2f}",
    ]
