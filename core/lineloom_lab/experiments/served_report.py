"""The closed path through a running service: the text's figures beside what it reached."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lineloom_lab.experiments.figure import Figure, grid
from lineloom_lab.experiments.path_figures import (
    ESTIMATED_COLOUR,
    MAP_COLOUR,
    TRUE_COLOUR,
    WALL_COLOUR,
)
from lineloom_lab.experiments.plan import Layer, Plan, segments_as_lines
from lineloom_lab.experiments.recording import CLOSED_PATH_M
from lineloom_lab.experiments.report import Report, Row
from lineloom_lab.experiments.served_path import ServedPath

PRINTED_MS = 3.48
"""Average time of matching a pair of scans (§6.2)."""

_NONE = "–"


def served_report(name: str, seed: int, runs: Sequence[ServedPath]) -> Report:
    """Put together what the service made of one recording with each matcher. name: of the path."""
    recording = runs[0].recording
    step = recording.length / (len(recording) - 1)
    return Report(
        name=f"{name}-served",
        title=f"Closed path, {len(recording)} scans, through a service",
        sections="§6.2, Fig. 6.2 to 6.5, 6.11",
        setup=(
            f"{len(recording)} scans of a simulated SICK LMS200 on {recording.length:.2f} m of a "
            f"closed path through a floor of 14 m x 7 m, {100 * step:.1f} cm apart; seed {seed}.",
            "They are posted to a running service, without odometry and with stamps of a robot at "
            "0.5 m/s, to a site for each matcher (parameter `matcher`); its trajectory and map are "
            "read once it is idle.",
        ),
        matchers=tuple(run.label for run in runs),
        rows=_rows(runs),
        figures=(_map_figure(f"{name}-served-map", runs),),
        differences=(
            "The thesis's floor and path are a picture without measures, and so are its curves: "
            "ours has their size, not their walls. Only what stands in the text has a figure here.",
            "The text chains the answers of consecutive pairs and believes every one. The service "
            "leaves a scan without a place where it is not sure, corrects the path by loops, and "
            "fuses a map of its own; errors are those of the largest component's scans.",
            "Line segments of consecutive scans are paired for the error area by where the served "
            "poses lay them on each other, within §6.3.1's 5° and 10 cm.",
        ),
        parameters={"seed": seed, "scans": len(recording), "path_m": recording.length},
        figures_of={run.key: run.figures() for run in runs},
        series={run.key: _series(run) for run in runs},
    )


def _series(run: ServedPath) -> dict[str, list[float]]:
    if not run.estimated:
        return {}
    distance, turned = run.errors(run.T_world_first)
    return {
        "scan": [float(i) for i in sorted(run.estimated)],
        "global_translational_error_m": distance.tolist(),
        "global_rotational_error_rad": turned.tolist(),
        "error_area_percentage": run.percentages.tolist(),
    }


def _rows(runs: Sequence[ServedPath]) -> tuple[Row, ...]:
    found = [run.figures() for run in runs]

    def row(what: str, text: str, printed: str = "", **scaled: float) -> Row:
        """One row; every name in `scaled` is a figure and what it is multiplied by."""
        cells = (
            text.format(*(f[k] * by for k, by in scaled.items())) if scaled.keys() <= f.keys()
            else _NONE
            for f in found
        )  # fmt: skip
        return Row(what, printed, tuple(cells))

    degrees = float(np.degrees(1.0))
    return (
        row("components", "{:.0f}", "one map, it seems", components=1),
        row("scans placed", "{:.0f} of {:.0f}", "all, it seems", placed=1, scans=1),
        row("scans in the largest component", "{:.0f}", in_largest=1),
        row(
            "error of the position, from S_0, max / mean", "{:.1f} / {:.1f} cm",
            error_from_first_max=100, error_from_first_mean=100,
        ),
        row("error of the heading, from S_0, max", "{:.2f}°", rotation_from_first_max=degrees),
        row(
            "error of the position, best alignment, max / mean", "{:.1f} / {:.1f} cm",
            error_max=100, error_mean=100,
        ),
        row(
            "error area percentage, median / mean", "{:.2f} % / {:.2f} %",
            error_area_percentage_median=1, error_area_percentage_mean=1,
        ),
        row("size of the map", "{:.2f} m x {:.2f} m", "14 m x 7 m", map_length=1, map_width=1),
        row("line segments in the map", "{:.0f}", map_lines=1),
        Row("distance travelled", f"{CLOSED_PATH_M} m",
            tuple(f"{run.recording.length:.2f} m" for run in runs)),
        row(
            "time a scan, from POST to idle", "{:.2f} ms", f"{PRINTED_MS} ms a pair",
            seconds_per_scan=1000,
        ),
    )  # fmt: skip


def _map_figure(name: str, runs: Sequence[ServedPath]) -> Figure:
    plans = []
    for run in runs:
        recording, T = run.recording, run.T_world_best
        path = np.array([(p.x, p.y) for _, p in sorted(run.estimated.items())]).reshape(-1, 2)
        layers = [
            Layer("true walls", segments_as_lines(recording.world.walls), WALL_COLOUR, 4.0),
            Layer("map", segments_as_lines(run.map_lines()), MAP_COLOUR, 1.6),
            Layer("true path", (recording.positions,), TRUE_COLOUR, 2.6),
            Layer("estimated path", (T.transform(path),), ESTIMATED_COLOUR, 1.6),
        ]
        plans.append(Plan(run.label, tuple(layer for layer in layers if len(layer.lines))))
    return Figure(
        name,
        f"Fig. 6.2, 6.4 through a service: map and path, {len(runs[0].recording)} scans",
        "The served line map with the true and the estimated path, for each matcher.",
        grid(plans),
        420.0,
    )
