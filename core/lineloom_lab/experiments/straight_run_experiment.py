"""18.65 m straight towards a corner: displacement and error area (§6.3.2, Fig. 6.9 and 6.10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_lab.evaluation.pose_error import pose_error
from lineloom_lab.experiments.chart import Chart, Series
from lineloom_lab.experiments.contestant import Contestant, answer_of
from lineloom_lab.experiments.figure import Figure
from lineloom_lab.experiments.plan import Layer, Plan, segments_as_lines
from lineloom_lab.experiments.recording import (
    STRAIGHT_RUN_M,
    STRAIGHT_RUN_SCANS,
    Recording,
    straight_run,
)
from lineloom_lab.experiments.report import Report, Row
from lineloom_lab.experiments.settings import Settings

SAMPLED_PAIRS = 6000
QUICK_SCANS, QUICK_PAIRS = 60, 150
REACH_M = 20.0
"""How far the default matcher looks here; by default 10 m, for which the run is too long."""
BIN_M = 0.25
"""Width of a bin of Fig. 6.10(b); the text has 1 cm, with all 1.09 million pairs."""


@dataclass(frozen=True, eq=False)
class PairAreas:
    """Pairs (S_i, S_j) by row. displacement: true, (n,) [m]. area: (n,) [m^2], percentage: (n,);
    NaN where there was no answer. translation: error of the answer, (n,) [m], NaN likewise."""

    displacement: NDArray[np.float64]
    area: NDArray[np.float64]
    percentage: NDArray[np.float64]
    translation: NDArray[np.float64]

    def binned(
        self, values: NDArray[np.float64], width: float = BIN_M
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centres of the bins that are not empty [m], and the mean of `values`, (n,), in each."""
        known = np.isfinite(values)
        bins = (self.displacement[known] / width).astype(np.int64)
        count = np.bincount(bins)
        total = np.bincount(bins, weights=values[known])
        full = np.flatnonzero(count)
        centres: NDArray[np.float64] = (full.astype(np.float64) + 0.5) * width
        return centres, total[full] / count[full]

    def slope(self, values: NDArray[np.float64]) -> float:
        """Least-squares slope of `values`, (n,), over displacement [1/m times their unit]."""
        known = np.isfinite(values)
        return float(np.polyfit(self.displacement[known], values[known], 1)[0])


@dataclass(frozen=True, eq=False)
class StraightRun:
    """One matcher's areas: S_0 against all others, and a sample of all pairs."""

    contestant: Contestant
    from_first: PairAreas
    sampled: PairAreas


def run_straight_run(settings: Settings) -> Report:
    """Match S_0 to every other scan, and a sample of all pairs by displacement (Fig. 6.10)."""
    scans = QUICK_SCANS if settings.quick else STRAIGHT_RUN_SCANS
    recording = straight_run(settings.seed, scans)
    wanted = QUICK_PAIRS if settings.quick else SAMPLED_PAIRS
    sample = sample_pairs(scans, wanted, settings.seed)
    runs = tuple(_run(c, recording, sample) for c in settings.contestants(reach=REACH_M))
    return Report(
        name="straight-run",
        title="Displacement and error area",
        sections="§6.3.2, Fig. 6.9, 6.10",
        setup=(
            f"{scans} scans on {recording.length:.2f} m straight towards the corner of two walls, "
            f"without turning; seed {settings.seed}.",
            f"S_0 is matched to all {scans - 1} others; of the {scans * (scans - 1) // 2} pairs "
            f"(S_i, S_j) a sample of {len(sample)}, even over j - i, is matched.",
        ),
        matchers=tuple(r.contestant.label for r in runs),
        rows=_rows(runs),
        figures=(_world_figure(recording), _figure(runs)),
        differences=_differences(runs, scans, len(sample)),
        parameters={
            "seed": settings.seed,
            "quick": settings.quick,
            "scans": scans,
            "run_m": recording.length,
            "sampled_pairs": len(sample),
            "bin_m": BIN_M,
        },
        figures_of={r.contestant.key: _figures(r) for r in runs},
        series={r.contestant.key: _series(r) for r in runs},
    )


def sample_pairs(scans: int, wanted: int, seed: int) -> list[tuple[int, int]]:
    """Draw different pairs i < j, their difference uniform over 1 .. scans - 1, in order."""
    rng = np.random.default_rng([seed, scans])
    most = scans * (scans - 1) // 2
    found: set[tuple[int, int]] = set()
    while len(found) < min(wanted, most // 2):
        apart = int(rng.integers(1, scans))
        i = int(rng.integers(0, scans - apart))
        found.add((i, i + apart))
    return sorted(found)


def _run(
    contestant: Contestant, recording: Recording, sample: Sequence[tuple[int, int]]
) -> StraightRun:
    prepared = [contestant.matcher.prepare(scan) for scan in recording.scans]
    first = [(0, i) for i in range(1, len(recording))]
    return StraightRun(
        contestant,
        _areas(contestant, recording, prepared, first),
        _areas(contestant, recording, prepared, sample),
    )


def _areas(
    contestant: Contestant,
    recording: Recording,
    prepared: Sequence[Any],
    pairs: Sequence[tuple[int, int]],
) -> PairAreas:
    rows = []
    for i, j in pairs:
        truth = recording.poses[i].between(recording.poses[j])
        result = contestant.matcher.match_prepared(prepared[i], prepared[j])
        pose = answer_of(result)
        apart = float(np.hypot(truth.x, truth.y))
        if pose is None:
            rows.append((apart, np.nan, np.nan, np.nan))
            continue
        area = contestant.area(prepared[i], prepared[j], result, pose)
        off = pose_error(pose, truth).translation
        rows.append((apart, area.error if area.pairs else np.nan, area.percentage, off))
    return PairAreas(*np.array(rows).T)


def _figures(run: StraightRun) -> dict[str, float]:
    def of(areas: PairAreas, name: str) -> dict[str, float]:
        return {
            f"{name}_area_mean": float(np.nanmean(areas.area)),
            f"{name}_area_median": float(np.nanmedian(areas.area)),
            f"{name}_area_p95": float(np.nanpercentile(areas.area, 95)),
            f"{name}_area_max": float(np.nanmax(areas.area)),
            f"{name}_percentage_mean": float(np.nanmean(areas.percentage)),
            f"{name}_slope": areas.slope(areas.area),
            f"{name}_percentage_slope": areas.slope(areas.percentage),
            f"{name}_right": float(np.mean(areas.translation < 0.3)),
            f"{name}_unanswered": int(np.isnan(areas.translation).sum()),
        }

    return {**of(run.from_first, "first"), **of(run.sampled, "all")}


def _series(run: StraightRun) -> dict[str, list[float]]:
    bins, means = run.sampled.binned(run.sampled.area)
    _, shares = run.sampled.binned(run.sampled.percentage)
    return {
        "first_displacement_m": run.from_first.displacement.tolist(),
        "first_error_area_m2": run.from_first.area.tolist(),
        "bin_centre_m": bins.tolist(),
        "bin_mean_error_area_m2": means.tolist(),
        "first_error_area_percentage": run.from_first.percentage.tolist(),
        "bin_mean_error_area_percentage": shares.tolist(),
    }


def _rows(runs: tuple[StraightRun, ...]) -> tuple[Row, ...]:
    found = [_figures(run) for run in runs]

    def both(what: str, text: str, suffix: str, printed: str = "", by: float = 1.0) -> list[Row]:
        return [
            Row(f"{who}: {what}", printed, tuple(text.format(by * f[key + suffix]) for f in found))
            for who, key in (("S_0 to all", "first_"), ("all pairs", "all_"))
        ]

    return (
        *both("right within 0.3 m", "{:.1f} %", "right", "all, it seems", 100.0),
        *both("no answer at all", "{:.0f}", "unanswered"),
        *both("mean error area", "{:.3f} m²", "area_mean"),
        *both("95 % below", "{:.3f} m²", "area_p95"),
        *both("greatest error area", "{:.3f} m²", "area_max"),
        *both("slope over displacement", "{:+.4f} m² per m", "slope", "no effect"),
        *both("mean error area percentage", "{:.3f} %", "percentage_mean"),
        *both("its slope over displacement", "{:+.4f} % per m", "percentage_slope"),
    )


def _world_figure(recording: Recording) -> Figure:
    plan = Plan(
        "two walls of 31 m and the run",
        (
            Layer("walls", segments_as_lines(recording.world.walls), "#1f2933", 3.0),
            Layer("run", (recording.positions,), "#009e73", 3.0),
        ),
    )
    return Figure(
        "straight-run-world",
        f"Fig. 6.9: the run of {recording.length:.2f} m to the intersection of two walls",
        "Two walls at a right angle and the robot's way into the corner.",
        ((plan,),),
        560.0,
    )


def _figure(runs: tuple[StraightRun, ...]) -> Figure:
    label = "true displacement (m)"

    def charts(what: str, y_label: str) -> tuple[Chart, Chart]:
        dots, means = [], []
        for r in runs:
            name, colour = r.contestant.label, r.contestant.colour
            values: NDArray[np.float64] = getattr(r.from_first, what)
            dots.append(Series(name, r.from_first.displacement, values, colour, "dots"))
            binned = r.sampled.binned(getattr(r.sampled, what))
            means.append(Series(name, *binned, colour))
        return (
            Chart("(a) S_0 to every S_i", label, y_label, tuple(dots)),
            Chart("(b) sampled pairs, mean per 25 cm", label, y_label, tuple(means)),
        )

    return Figure(
        "straight-run",
        "Fig. 6.10: displacement and error area",
        "Error area and its percentage against the true displacement of two scans.",
        (charts("area", "error area (m^2)"), charts("percentage", "error area percentage")),
        400.0,
    )


def _differences(runs: tuple[StraightRun, ...], scans: int, sampled: int) -> tuple[str, ...]:
    told = [
        f"A sample of {sampled} pairs stands for all {scans * (scans - 1) // 2}, so bins are 25 cm "
        "wide, not 1 cm; means within a bin scatter more than printed.",
        "Fig. 6.9 gives no measures: here two walls of 31 m meet at a right angle, long enough to "
        "fill the view all the way, and the run ends 2 m before the corner.",
    ]
    if any(run.contestant.key == "default" for run in runs):
        told.append(
            f"The default matcher looks {REACH_M:g} m far here; by default it looks 10 m far, and "
            "every pair beyond that would be wrong."
        )
    for run in runs:
        told.extend(_effects(run))
    told.append(
        "Why it falls where it falls: areas are taken from the current pose, and in a corner all "
        "that is seen shrinks with the square of the distance to it. The pairs with the greatest "
        "displacement end right before the corner. The percentage, which is relative to what is "
        "seen, shows what is left when that is taken out."
    )
    return tuple(told)


def _effects(run: StraightRun) -> list[str]:
    """Sentences on whether displacement has an effect, and S_0 against all pairs."""
    f, who = _figures(run), run.contestant.label
    told = []
    for name, what in (("first", "S_0 to all"), ("all", "all pairs")):
        change, mean = STRAIGHT_RUN_M * f[f"{name}_slope"], f[f"{name}_area_mean"]
        says = "hardly any effect" if abs(change) < 0.5 * mean else "an effect"
        told.append(
            f"{who[0].upper()}{who[1:]}, {what}: {says} of displacement on error area "
            f"({change:+.3f} m² over the run, mean {mean:.3f} m²); the text finds none."
        )
    holds = "holds" if f["all_area_mean"] > f["first_area_mean"] else "does not hold"
    told.append(
        f"That all pairs have a larger mean than S_0 to all {holds} for the {who}: "
        f"{f['all_area_mean']:.3f} against {f['first_area_mean']:.3f} m²."
    )
    return told
