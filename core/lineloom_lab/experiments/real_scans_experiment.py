"""Real scans: a map, the end point's error, and error area where the robot turns (§6.4)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.io.carmen import read_carmen
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.experiments.chain import Chain, match_chain
from lineloom_lab.experiments.chart import Chart, Series
from lineloom_lab.experiments.contestant import Contestant
from lineloom_lab.experiments.figure import Figure, grid
from lineloom_lab.experiments.path_errors import PathErrors, path_errors
from lineloom_lab.experiments.plan import Layer, Plan, segments_as_lines
from lineloom_lab.experiments.report import MissingDataError, Report, Row
from lineloom_lab.experiments.settings import Settings

LOG, REFERENCE = "fr079/fr079.log", "fr079/reference.npz"
SCANS, QUICK_SCANS = 237, 30
"""After 237 scans the robot is back where it began, to 12 cm."""
TURNING_RAD = np.radians(4.0)
"""A pair turned by more than this counts as taken while turning."""


@dataclass(frozen=True, eq=False)
class RealRun:
    """What one matcher made of the log.

    turned: true turn of each pair, (n - 1,) [rad], absolute. end: error of the last pose in the
    frame of the first scan, estimate minus reference [m, rad].
    """

    contestant: Contestant
    chain: Chain
    errors: PathErrors
    turned: NDArray[np.float64]
    end: Pose

    def figures(self) -> dict[str, float]:
        """Return what a script wants to know; metres, radians, percent."""
        share = self.chain.percentages
        right = (self.errors.translation < 0.3) & (self.errors.rotation < np.radians(5.0))
        turning = self.turned > TURNING_RAD
        return {
            "pairs": len(share),
            "right": int(right.sum()),
            "end_x": self.end.x,
            "end_y": self.end.y,
            "end_rotation": self.end.theta,
            "translation_median": float(np.median(self.errors.translation)),
            "rotation_median": float(np.median(self.errors.rotation)),
            "global_translation_max": float(self.errors.global_translation.max()),
            "percentage_median": float(np.nanmedian(share)),
            "percentage_turning": _median(share[right & turning]),
            "percentage_straight": _median(share[right & ~turning]),
            "turning_pairs": int((right & turning).sum()),
            "map_lines": len(self.chain.line_map),
        }


def run_real_scans(settings: Settings) -> Report:
    """Map the first loop of a real log; raises MissingDataError where there is none."""
    count = QUICK_SCANS if settings.quick else SCANS
    scans, poses = _load(settings.data, count)
    runs = tuple(_run(c, scans, poses) for c in settings.contestants(order_extension=True))
    length = float(sum(a.distance(b) for a, b in pairwise(poses)))
    return Report(
        name="real-scans",
        title="Real scans",
        sections="§6.4, Fig. 6.12, 6.13",
        setup=(
            f"The first {count} scans of fr079 (Freiburg, building 079: SICK LMS, 360 beams), "
            f"{length:.1f} m through a hall"
            + ("." if settings.quick else ", back to where they began to 12 cm."),
            "Scans alone are matched, each to the one before; the published poses "
            "(reference.npz, ref_gfs) serve as reference only. The thesis's matcher runs with "
            "§5.7's order extension.",
        ),
        matchers=tuple(r.contestant.label for r in runs),
        rows=_rows(runs),
        figures=(_map_figure(scans, poses, runs), _area_figure(runs)),
        differences=_differences(runs),
        parameters={"quick": settings.quick, "scans": count, "path_m": length},
        figures_of={r.contestant.key: r.figures() for r in runs},
        series={
            r.contestant.key: {
                "error_area_percentage": r.chain.percentages.tolist(),
                "turned_rad": r.turned.tolist(),
                "translational_error_m": r.errors.translation.tolist(),
                "global_translational_error_m": r.errors.global_translation.tolist(),
            }
            for r in runs
        },
    )


def _load(data: Path | None, count: int) -> tuple[tuple[Scan, ...], tuple[Pose, ...]]:
    """Read the first scans of the log and their reference poses, T_world_laser."""
    if data is None:
        raise MissingDataError("real-scans needs real data: name its folder (../shared/data)")
    for name in (LOG, REFERENCE):
        if not (data / name).is_file():
            raise MissingDataError(f"real-scans reads {data / name}, which does not exist")
    scans = tuple(islice(read_carmen(data / LOG), count))
    with np.load(data / REFERENCE, allow_pickle=False) as reference:
        rows = reference["ref_gfs"][: len(scans)].astype(np.float64)
    return scans, tuple(Pose.from_array(row) for row in rows)


def _run(contestant: Contestant, scans: tuple[Scan, ...], poses: tuple[Pose, ...]) -> RealRun:
    chain = match_chain(contestant, scans, poses[0])
    estimate, truth = poses[0].between(chain.poses[-1]), poses[0].between(poses[-1])
    turned = [abs(a.between(b).theta) for a, b in pairwise(poses)]
    off = (truth.inverse() @ estimate).theta
    return RealRun(
        contestant,
        chain,
        path_errors(chain.poses, poses),
        np.array(turned),
        Pose(estimate.x - truth.x, estimate.y - truth.y, off),
    )


def _median(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _rows(runs: tuple[RealRun, ...]) -> tuple[Row, ...]:
    found = [run.figures() for run in runs]
    degrees = float(np.degrees(1.0))

    def row(what: str, text: str, printed: str = "", **scaled: float) -> Row:
        cells = [text.format(*(f[k] * by for k, by in scaled.items())) for f in found]
        return Row(what, printed, tuple(cells))

    return (
        row("right (< 0.3 m, < 5°)", "{:.0f} of {:.0f}", right=1, pairs=1),
        row(
            "translational error at the end (x, y)",
            "({:.2f} cm, {:.2f} cm)",
            "(7.84 cm, -0.66 cm)",
            end_x=100,
            end_y=100,
        ),
        row("rotational error at the end", "{:.2f}°", "2.12°", end_rotation=degrees),
        row("greatest global translational error", "{:.2f} m", global_translation_max=1),
        row(
            "error of a pair, median",
            "{:.1f} cm, {:.2f}°",
            translation_median=100,
            rotation_median=degrees,
        ),
        row("error area percentage, median", "{:.2f} %", percentage_median=1),
        row(
            "the same, turning / going straight",
            "{:.2f} % / {:.2f} %",
            "higher when turning",
            percentage_turning=1,
            percentage_straight=1,
        ),
        row("line segments in the map", "{:.0f}", map_lines=1),
    )


def _map_figure(
    scans: tuple[Scan, ...], poses: tuple[Pose, ...], runs: tuple[RealRun, ...]
) -> Figure:
    dots = tuple(
        np.array([p, (p[0] + 0.01, p[1])])
        for scan, pose in zip(scans[::4], poses[::4], strict=True)
        for p in pose.transform(scan.points()[::3])
    )
    true = np.array([(p.x, p.y) for p in poses])
    raw = Layer("points, placed by the reference", dots, "#7b8794", 1.2)
    reference = Layer("reference path", (true,), "#009e73", 2.6)
    plans = [Plan("(a) raw scans", (raw, reference))]
    for run in runs:
        path = np.array([(p.x, p.y) for p in run.chain.poses])
        map_lines = segments_as_lines(run.chain.map_segments())
        layers = (
            Layer("map", map_lines, "#1d4ed8", 1.5),
            reference,
            Layer("estimated path", (path,), "#c1121f", 1.6),
        )
        plans.append(Plan(f"(b) {run.contestant.label}", layers))
    text = "Raw points, and the maps built from scans alone."
    return Figure("real-scans-map", "Fig. 6.12: real scans", text, grid(plans, 1), 420.0)


def _area_figure(runs: tuple[RealRun, ...]) -> Figure:
    def series(run: RealRun, x: NDArray[np.float64], style: str) -> Series:
        dots = style == "dots"
        label, colour = run.contestant.label, run.contestant.colour
        return Series(label, x, run.chain.percentages, colour, "dots" if dots else "line")

    numbers = np.arange(len(runs[0].turned), dtype=np.float64)
    by_scan = tuple(series(r, numbers, "line") for r in runs)
    by_turn = tuple(series(r, np.degrees(r.turned), "dots") for r in runs)
    rows = (
        (Chart("(a) by scan", "scan number i", "error area percentage", by_scan),),
        (
            Chart(
                "(b) by the turn between the scans",
                "turn between S_i and S_i+1 (degrees)",
                "error area percentage",
                by_turn,
            ),
        ),
    )
    text = "Error area percentage of real scans by number and by turn."
    return Figure("real-scans-error-area", "Fig. 6.13: error area percentage", text, rows)


def _differences(runs: tuple[RealRun, ...]) -> tuple[str, ...]:
    told = [
        "The thesis's home from Radish is not at hand: another building, another robot, other "
        "steps. Its errors are printed beside ours as orders of size only, and it does not say "
        "at which pose it took them.",
        "The reference poses are an estimate by others and good to some centimetres.",
    ]
    for run in runs:
        f, who = run.figures(), run.contestant.label
        if f["right"] < f["pairs"]:
            told.append(
                f"The {who} gets {f['pairs'] - f['right']:.0f} of {f['pairs']:.0f} pairs wrong; "
                "nothing corrects a chain, so they displace all of the path and map that follow."
            )
        turning, straight = f["percentage_turning"], f["percentage_straight"]
        if np.isfinite(turning) and np.isfinite(straight):
            holds = "holds" if turning > straight else "does not hold"
            told.append(
                f"That turning makes error areas larger {holds} for the {who}: {turning:.2f} % "
                f"while turning by more than 4° ({f['turning_pairs']:.0f} pairs), {straight:.2f} % "
                "otherwise, right pairs only."
            )
    return tuple(told)
