"""The figures of the closed path: map and paths, a close look, four errors, error area (§6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lineloom_lab.experiments.chart import Chart, Series
from lineloom_lab.experiments.figure import Figure, grid
from lineloom_lab.experiments.plan import Bounds, Layer, Plan, segments_as_lines
from lineloom_lab.experiments.recording import Recording

if TYPE_CHECKING:
    from lineloom_lab.experiments.path_experiment import PathRun

TRUE_COLOUR = "#009e73"
ESTIMATED_COLOUR = "#c1121f"
MAP_COLOUR = "#1d4ed8"
WALL_COLOUR = "#c9ced6"
_ZOOM_M, _ZOOM_WIDE_M = 2.0, 4.0


def figures(name: str, recording: Recording, runs: Sequence[PathRun]) -> tuple[Figure, ...]:
    """Draw what Fig. 6.2, 6.3 and 6.11(a), or 6.4, 6.5 and 6.11(b), show."""
    dense = name == "closed-path"
    maps, errors, areas = ("6.2", "6.3", "6.11(a)") if dense else ("6.4", "6.5", "6.11(b)")
    return (
        _map_figure(f"{name}-map", f"Fig. {maps}: map and path", recording, runs),
        _error_figure(f"{name}-errors", f"Fig. {errors}: errors by scan number", runs),
        _area_figure(f"{name}-error-area", f"Fig. {areas}: error area percentage", runs),
    )


def _map_figure(name: str, title: str, recording: Recording, runs: Sequence[PathRun]) -> Figure:
    plans = []
    for run in runs:
        path = np.array([(p.x, p.y) for p in run.chain.poses])
        layers = _layers(recording, run, path)
        plans.append(Plan(f"(a) {run.contestant.label}", layers))
        zoom = _zoom(recording.positions, path)
        plans.append(Plan(f"(b) {run.contestant.label}, a close look", layers, zoom))
    return Figure(
        name,
        f"{title}, {len(recording)} scans, {recording.length:.2f} m",
        "Line map built by Algorithm 11 with the true and the estimated path, and a close look.",
        grid(plans),
        420.0,
    )


def _layers(recording: Recording, run: PathRun, path: NDArray[np.float64]) -> tuple[Layer, ...]:
    width = 1.4 if len(path) > 100 else 1.8
    return (
        Layer("true walls", segments_as_lines(recording.world.walls), WALL_COLOUR, 4.0),
        Layer("map", segments_as_lines(run.chain.map_segments()), MAP_COLOUR, 1.6),
        Layer("true path", (recording.positions,), TRUE_COLOUR, width + 1.0),
        Layer("estimated path", (path,), ESTIMATED_COLOUR, width),
    )


def _zoom(true: NDArray[np.float64], path: NDArray[np.float64]) -> Bounds:
    """Around the greatest displacement, or around where the path first leaves the true one."""
    apart = np.hypot(*(path - true).T)
    far = np.flatnonzero(apart > 0.5)
    at = int(far[0]) if len(far) else int(np.argmax(apart))
    x, y = true[at].tolist()
    half = 0.5 * (_ZOOM_WIDE_M if len(far) else _ZOOM_M)
    return x - 1.5 * half, y - half, x + 1.5 * half, y + half


def _error_figure(name: str, title: str, runs: Sequence[PathRun]) -> Figure:
    degrees, cm = float(np.degrees(1.0)), 100.0
    charts = [
        _chart("(a) rotational error, S_i to S_i+1", "degrees", runs, "rotation", degrees),
        _chart("(b) translational error, S_i to S_i+1", "cm", runs, "translation", cm),
        _chart("(c) global rotational error of S_i", "degrees", runs, "global_rotation", degrees),
        _chart("(d) global translational error of S_i", "cm", runs, "global_translation", cm),
    ]
    return Figure(name, title, "Four errors of the path by scan number.", grid(charts))


def _chart(title: str, unit: str, runs: Sequence[PathRun], field: str, factor: float) -> Chart:
    series = tuple(
        _by_scan(run, factor * getattr(run.errors, field), first=int(field.startswith("global")))
        for run in runs
    )
    return Chart(title, "scan number i", unit, series)


def _area_figure(name: str, title: str, runs: Sequence[PathRun]) -> Figure:
    series = tuple(_by_scan(run, run.chain.percentages, first=0) for run in runs)
    chart = Chart("error area percentage, S_i to S_i+1", "scan number i", "percent", series)
    return Figure(name, title, "Error area percentage of each pair of scans.", ((chart,),))


def _by_scan(run: PathRun, values: NDArray[np.float64], first: int) -> Series:
    numbers = np.arange(first, first + len(values), dtype=np.float64)
    return Series(run.contestant.label, numbers, values, run.contestant.colour)
