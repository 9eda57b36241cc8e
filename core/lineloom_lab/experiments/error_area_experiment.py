"""Injected pose error against error area, a scan on its own copy (§6.3.1, Fig. 6.7 and 6.8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.evaluation.error_area import ErrorArea
from lineloom_lab.experiments.chart import Chart, Series
from lineloom_lab.experiments.contestant import Contestant, rows
from lineloom_lab.experiments.figure import Figure
from lineloom_lab.experiments.plan import Layer, Plan, segments_as_lines
from lineloom_lab.experiments.recording import SPARSE_PATH_SCANS, closed_path
from lineloom_lab.experiments.report import Report, Row
from lineloom_lab.experiments.settings import Settings

SCAN_NUMBER = 11
"""Which scan of the sparse path is shown, chosen for a curve that rises as the printed one does;
how many of all scans rise within the thesis's windows is in the table."""
ROTATION_END_RAD = math.radians(15.0)
TRANSLATION_END_M = 0.5
WINDOW_RAD, WINDOW_M = math.radians(5.0), 0.1
"""Within these the thesis checks that lines are parallel after the alignment (§6.3.1)."""
DIRECTIONS = 16


@dataclass(frozen=True, eq=False)
class InjectedErrors:
    """Mean areas over the directions (both senses) of each injected error.

    injected: (n,) [rad] or [m]. area: (n,) [m^2]. percentage: (n,) 0..100.
    """

    injected: NDArray[np.float64]
    area: NDArray[np.float64]
    percentage: NDArray[np.float64]

    def at(self, error: float) -> float:
        """Area [m^2] at an injected error, between the samples on a straight line."""
        return float(np.interp(error, self.injected, self.area))


@dataclass(frozen=True, eq=False)
class SelfMatch:
    """A scan matched to its copy by one matcher."""

    contestant: Contestant
    result: MatchResult
    segments: NDArray[np.float64]
    rotation: InjectedErrors
    translation: InjectedErrors
    rising: tuple[int, int]
    """Of all scans of the path: how many areas rise all the way to 5°, and to 10 cm."""


def run_error_area(settings: Settings) -> Report:
    """Match a scan with its exact copy and inject rotation and translation into the alignment."""
    scans = closed_path(settings.seed, SPARSE_PATH_SCANS).scans
    scan = scans[SCAN_NUMBER]
    steps = 10 if settings.quick else 91
    runs = tuple(_self_match(c, scans, steps) for c in settings.contestants())
    return Report(
        name="error-area",
        title="Pose error and error area",
        sections="§6.3.1, Fig. 6.7, 6.8",
        setup=(
            "A scan of the closed path is matched with its exact copy, so that the match itself "
            f"has no pose error; rotations of 0 to {math.degrees(ROTATION_END_RAD):.0f}° (mean of "
            f"both senses) and translations of 0 to {TRANSLATION_END_M:g} m (mean of {DIRECTIONS} "
            f"directions) are added to the alignment, in {steps} steps each; seed {settings.seed}.",
        ),
        matchers=tuple(r.contestant.label for r in runs),
        rows=_rows(runs),
        figures=(_scan_figure(scan, runs), _figure(runs)),
        differences=_differences(runs),
        parameters={"seed": settings.seed, "quick": settings.quick, "steps": steps},
        figures_of={r.contestant.key: _figures(r) for r in runs},
        series={r.contestant.key: _series(r) for r in runs},
    )


def inject(
    contestant: Contestant, scan: Scan, errors: Sequence[Sequence[Pose]]
) -> list[list[ErrorArea]]:
    """Error areas of a scan on its copy for groups of injected errors, T_reference_current."""
    prepared = contestant.matcher.prepare(scan)
    result = contestant.matcher.match_prepared(prepared, prepared)
    return [[contestant.area(prepared, prepared, result, p) for p in group] for group in errors]


def turned_by(angle: float) -> list[Pose]:
    """Both senses of a rotation [rad]."""
    return [Pose(0.0, 0.0, angle), Pose(0.0, 0.0, -angle)]


def shifted_by(distance: float) -> list[Pose]:
    """A translation [m] in all directions."""
    bearings = [math.tau * k / DIRECTIONS for k in range(DIRECTIONS)]
    return [Pose(distance * math.cos(b), distance * math.sin(b), 0.0) for b in bearings]


def _self_match(contestant: Contestant, scans: Sequence[Scan], steps: int) -> SelfMatch:
    scan = scans[SCAN_NUMBER]
    prepared = contestant.matcher.prepare(scan)
    turns = np.linspace(0.0, ROTATION_END_RAD, steps)
    shifts = np.linspace(0.0, TRANSLATION_END_M, steps)
    turned = [turned_by(angle) for angle in turns.tolist()]
    shifted = [shifted_by(distance) for distance in shifts.tolist()]
    rising = [_rising(contestant, one) for one in scans]
    return SelfMatch(
        contestant,
        contestant.matcher.match_prepared(prepared, prepared),
        rows(contestant.segments(prepared)),
        _mean(turns, inject(contestant, scan, turned)),
        _mean(shifts, inject(contestant, scan, shifted)),
        (sum(turn for turn, _ in rising), sum(shift for _, shift in rising)),
    )


def _rising(contestant: Contestant, scan: Scan, steps: int = 6) -> tuple[bool, bool]:
    """Does the area rise at every step up to 5°, and up to 10 cm?"""
    turns = np.linspace(0.0, WINDOW_RAD, steps)
    shifts = np.linspace(0.0, WINDOW_M, steps)
    by_turn = inject(contestant, scan, [turned_by(a) for a in turns.tolist()])
    by_shift = inject(contestant, scan, [shifted_by(d) for d in shifts.tolist()])
    areas = (_mean(turns, by_turn).area, _mean(shifts, by_shift).area)
    turn, shift = (bool(np.all(np.diff(area) > 0.0)) for area in areas)
    return turn, shift


def _mean(injected: NDArray[np.float64], areas: list[list[ErrorArea]]) -> InjectedErrors:
    return InjectedErrors(
        injected,
        np.array([np.mean([a.error for a in group]) for group in areas]),
        np.array([np.nanmean([a.percentage for a in group]) for group in areas]),
    )


def _figures(run: SelfMatch) -> dict[str, float]:
    return {
        "line_segments": len(run.segments),
        "pairs": len(run.result.pairs),
        "area_at_5_degrees": run.rotation.at(WINDOW_RAD),
        "area_at_10_cm": run.translation.at(WINDOW_M),
        "rising_to_5_degrees": run.rising[0],
        "rising_to_10_cm": run.rising[1],
        "area_at_rotation_end": float(run.rotation.area[-1]),
        "area_at_translation_end": float(run.translation.area[-1]),
    }


def _series(run: SelfMatch) -> dict[str, list[float]]:
    return {
        "rotation_rad": run.rotation.injected.tolist(),
        "rotation_error_area_m2": run.rotation.area.tolist(),
        "rotation_error_area_percentage": run.rotation.percentage.tolist(),
        "translation_m": run.translation.injected.tolist(),
        "translation_error_area_m2": run.translation.area.tolist(),
        "translation_error_area_percentage": run.translation.percentage.tolist(),
    }


def _rows(runs: tuple[SelfMatch, ...]) -> tuple[Row, ...]:
    found = [_figures(run) for run in runs]

    def cells(key: str, text: str) -> tuple[str, ...]:
        return tuple(text.format(f[key]) for f in found)

    turn, shift = math.degrees(ROTATION_END_RAD), TRANSLATION_END_M
    n = SPARSE_PATH_SCANS
    return (
        Row("line segments of the scan", "", cells("line_segments", "{:.0f}")),
        Row("matching pairs", "all", cells("pairs", "{:.0f}")),
        Row("error area without injected error", "0", tuple(_at_zero(r) for r in runs)),
        Row("error area at 5°", "", cells("area_at_5_degrees", "{:.2f} m²")),
        Row("error area at 10 cm", "", cells("area_at_10_cm", "{:.2f} m²")),
        Row(f"error area at {turn:.0f}°", "", cells("area_at_rotation_end", "{:.1f} m²")),
        Row(f"error area at {shift:g} m", "", cells("area_at_translation_end", "{:.1f} m²")),
        Row(f"of {n} scans, area rises up to 5°", "", cells("rising_to_5_degrees", "{:.0f}")),
        Row(f"of {n} scans, area rises up to 10 cm", "", cells("rising_to_10_cm", "{:.0f}")),
    )


def _at_zero(run: SelfMatch) -> str:
    return f"{run.rotation.area[0]:.3g} m²"


def _scan_figure(scan: Scan, runs: tuple[SelfMatch, ...]) -> Figure:
    dots = tuple(np.array([p, (p[0] + 0.002, p[1])]) for p in scan.points())
    plans = tuple(
        Plan(
            f"{run.contestant.label}: {len(run.segments)} line segments",
            (
                Layer("points", dots, "#9aa5b1", 4.0),
                Layer("line segments", segments_as_lines(run.segments), run.contestant.colour, 2.0),
                Layer("laser", (np.array([[0.0, 0.0], [0.35, 0.0]]),), "#009e73", 5.0),
            ),
        )
        for run in runs
    )
    return Figure(
        "error-area-scan",
        "Fig. 6.7: the scan whose copy is displaced",
        "Points and line segments of the scan.",
        (plans,),
        480.0,
    )


def _figure(runs: tuple[SelfMatch, ...]) -> Figure:
    degrees = float(np.degrees(1.0))

    def chart(title: str, x_label: str, y_label: str, kind: str, what: str, by: float) -> Chart:
        series = []
        for run in runs:
            errors: InjectedErrors = getattr(run, kind)
            values: NDArray[np.float64] = getattr(errors, what)
            label, colour = run.contestant.label, run.contestant.colour
            series.append(Series(label, by * errors.injected, values, colour))
        return Chart(title, x_label, y_label, tuple(series))

    turn, shift = "injected rotation (degrees)", "injected translation (cm)"
    return Figure(
        "error-area",
        "Fig. 6.8: injected error and error area",
        "Error area and its percentage against injected rotation and translation.",
        (
            (
                chart("(a) rotation", turn, "error area (m^2)", "rotation", "area", degrees),
                chart("(b) translation", shift, "error area (m^2)", "translation", "area", 100.0),
            ),
            (
                chart(
                    "(a) rotation, as a percentage",
                    turn,
                    "percent",
                    "rotation",
                    "percentage",
                    degrees,
                ),
                chart(
                    "(b) translation, as a percentage",
                    shift,
                    "percent",
                    "translation",
                    "percentage",
                    100.0,
                ),
            ),
        ),
    )


def _differences(runs: tuple[SelfMatch, ...]) -> tuple[str, ...]:
    told = [
        "The scan of Fig. 6.7 is a picture; ours is one of the 14 m x 7 m floor. The ranges of the "
        "injected errors are not in the text either, only that 5° and 10 cm are small portions of "
        "them.",
        "As printed, the area grows with the injected error, for this scan, which was chosen for "
        "it. For others it levels off or falls beyond about 5°: the pairs stay those of the match, "
        "but, turned or shifted that far, fewer of their line segments share a bearing, and where "
        "they share none nothing lies between them by the definition of §6.3. The percentage, "
        "which loses what it is relative to as well, keeps rising.",
        "The percentage against injected errors is not in the thesis; it has it for paths only.",
    ]
    told.extend(
        f"The {run.contestant.label} pairs {len(run.result.pairs)} of the {len(run.segments)} "
        "line segments with themselves; the others add no area."
        for run in runs
        if len(run.result.pairs) < len(run.segments)
    )
    return tuple(told)
