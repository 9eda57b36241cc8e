"""The benchmark of lines as a table for people and as JSON."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from statistics import fmean
from typing import Any

from lineloom_lab.evaluation.line_bench import LineResult
from lineloom_lab.evaluation.line_bench_judge import LineFigures
from lineloom_lab.evaluation.log_bench_table import percent, table

LEGEND = """\
P3, P5: share of the lines' length within 3, 5 cm of a side of a true wall, shape alone (lines lie
as the keyframes around them do); P5 map: with the map's drift. R3, R5: share of the seen faces that
lines cover so. pieces: lines a face. corners: of true ones, where two lines meet within 2 cm.
angle: rms, degrees. false: lines off every side by 10 cm. off/σ: rms offset over the sigma told.
short: share of length in lines under 0.5 m. twins: metres in 100 beside a line of the same side
within 20 cm. ends met: of lines from 1 m on, ends that coincide with another's within 2 cm."""


def _plain(value: float | None, digits: int = 2) -> str:
    return "" if value is None else f"{value:.{digits}f}"


_COLUMNS: dict[str, Callable[[LineFigures], str]] = {
    "lines": lambda f: f"{f.lines}",
    "metres": lambda f: f"{f.metres:.0f}",
    "P3 %": lambda f: percent(f.precision_3),
    "P5 %": lambda f: percent(f.precision_5),
    "P5 map %": lambda f: percent(f.whole_5),
    "R3 %": lambda f: percent(f.recall_3),
    "R5 %": lambda f: percent(f.recall_5),
    "pieces": lambda f: _plain(f.pieces),
    "corners %": lambda f: percent(f.corners),
    "angle": lambda f: "" if f.angle is None else _plain(57.29578 * f.angle),
    "false": lambda f: "" if f.false_lines is None else f"{f.false_lines}",
    "off/σ": lambda f: _plain(f.sigma_ratio),
    "short %": lambda f: percent(f.short),
    "twins": lambda f: _plain(f.twins),
    "ends met %": lambda f: percent(f.ends_met),
}


def lines_json(results: Sequence[LineResult]) -> dict[str, Any]:
    """Return all figures for scripts: a row per case, and the means of the halves."""
    rows = [{"case": r.name, "half": r.half, **asdict(r.figures)} for r in results]
    return {"rows": rows, "halves": [{"half": h, **asdict(f)} for h, f in _halves(results)]}


def lines_markdown(results: Sequence[LineResult]) -> str:
    """Return a table of all cases, the means of simulated ones by halves, and the legend."""
    rows = [["case", "half", *_COLUMNS]]
    rows += [[r.name, r.half, *(of(r.figures) for of in _COLUMNS.values())] for r in results]
    for half, mean in _halves(results):
        rows.append([f"mean of {half}", half, *(of(mean) for of in _COLUMNS.values())])
    return f"{table(rows, 2)}\n\n{LEGEND}"


def _halves(results: Sequence[LineResult]) -> list[tuple[str, LineFigures]]:
    """Means over the simulated floors of each half; counts are rounded."""
    found = []
    for half in ("A", "B"):
        mine = [
            asdict(r.figures)
            for r in results
            if r.half == half and r.figures.precision_5 is not None
        ]
        if mine:
            mean = {name: fmean(f[name] for f in mine) for name in mine[0]}
            whole: dict[str, Any] = {n: round(mean[n]) for n in ("lines", "false_lines")}
            found.append((half, LineFigures(**{**mean, **whole})))
    return found
