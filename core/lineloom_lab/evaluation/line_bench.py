"""How good the map's lines are: simulated floors against what was seen of them, real logs alone.

Steps of `run_line_case`: 1. read or simulate the log; 2. map it as a service would; 3. carry the
lines into the world as the keyframes lie there (`carried`); 4. judge them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.mapping.answers.site_view import MapLine, SiteView
from numpy.typing import NDArray

from lineloom_lab.evaluation.line_bench_floors import Floor
from lineloom_lab.evaluation.line_bench_judge import (
    LineFigures,
    carried,
    ends_of,
    judge_alone,
    judge_by_truth,
)
from lineloom_lab.evaluation.line_bench_truth import TrueFaces, seen_faces
from lineloom_lab.evaluation.log_bench import play, robots_of
from lineloom_lab.evaluation.log_bench_cases import Setting
from lineloom_lab.evaluation.log_bench_log import Half, LogSource, Recording

LineSource = Floor | LogSource
"""A simulated floor, whose walls are known, or a log."""


@dataclass(frozen=True, eq=False)
class LineMap:
    """One case's largest component: what there is to judge.

    lines: of the map. near, whole: their ends in the world, (n, 4) [m], carried in both ways; those
    of the map itself where nothing is known. truth: None for a real log.
    """

    lines: tuple[MapLine, ...]
    near: NDArray[np.float64]
    whole: NDArray[np.float64]
    truth: TrueFaces | None


@dataclass(frozen=True, slots=True)
class LineResult:
    """What a case came to. half: buildings that parameters are chosen with (A), or not (B)."""

    name: str
    half: Half
    figures: LineFigures


def run_line_bench(
    sources: Sequence[LineSource],
    on_progress: Callable[[str], None] = lambda _: None,
) -> tuple[LineResult, ...]:
    """Run all cases in order. A log that cannot be read raises ValueError or OSError."""
    results = []
    for source in sources:
        results.append(run_line_case(source))
        on_progress(f"{len(results)}/{len(sources)} {source.name}")
    return tuple(results)


def run_line_case(source: LineSource) -> LineResult:
    """Map one log and judge its lines."""
    robots = robots_of(source.load(), Setting())
    view, _ = play(robots, None)
    found = map_of(source, robots, view)
    return LineResult(source.name, source.half, judged(found))


def judged(found: LineMap) -> LineFigures:
    """Return the figures of a map."""
    if found.truth is None:
        return judge_alone(found.near)
    sigma = np.array([line.sigma for line in found.lines])
    return judge_by_truth(found.near, found.whole, sigma, found.truth)


def map_of(source: LineSource, robots: Sequence[Recording], view: SiteView) -> LineMap:
    """Return what a log's map has to be judged by: lines that are taken for real."""
    largest = max(view.components, key=lambda c: c.keyframes).id
    lines = tuple(w for w in view.lines if w.component == largest)
    ends = ends_of(lines)
    if not isinstance(source, Floor):
        return LineMap(lines, ends, ends, None)
    reference = {robot.robot: robot.reference for robot in robots}
    frames = [k for k in view.keyframes if k.component == largest]
    mapped = np.array([k.pose.to_array() for k in frames])
    true = np.array([reference[k.robot][k.seq] for k in frames])
    truth = seen_faces(source.world, source.lidar, true)
    near, whole = (carried(ends, mapped, true, near=local) for local in (True, False))
    return LineMap(lines, near, whole, truth)
