"""Time per pair, beside the thesis's 3.48 ms (§6.2)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_lab.experiments.chart import Chart, Series
from lineloom_lab.experiments.contestant import Contestant
from lineloom_lab.experiments.figure import Figure
from lineloom_lab.experiments.recording import (
    CLOSED_PATH_SCANS,
    SPARSE_PATH_SCANS,
    Recording,
    closed_path,
)
from lineloom_lab.experiments.report import Report, Row
from lineloom_lab.experiments.settings import Settings

PRINTED_MS = 3.48
"""Average time for matching two scans (§6.2, Fig. 6.2)."""
SCAN_MS = 24.0
"""What the text calls the recording time of a scan (§6.2)."""
PAIRS, QUICK_PAIRS = 400, 20
_PERCENTILES = np.arange(0.0, 101.0, 2.0)


@dataclass(frozen=True, eq=False)
class Times:
    """CPU milliseconds of one matcher. prepare: per scan, (n,). match: per pair, (m,)."""

    prepare: NDArray[np.float64]
    match: NDArray[np.float64]

    @property
    def whole(self) -> float:
        """Mean of a pair with both extractions."""
        return float(self.match.mean() + 2.0 * self.prepare.mean())


@dataclass(frozen=True, eq=False)
class Timing:
    """One matcher's times on pairs of the dense and of the sparse path."""

    contestant: Contestant
    dense: Times
    sparse: Times


def run_timing(settings: Settings) -> Report:
    """Time preparation and match of consecutive scans of both closed paths, on one core."""
    pairs = QUICK_PAIRS if settings.quick else PAIRS
    whole = closed_path(settings.seed, CLOSED_PATH_SCANS)
    dense = _spread(whole, pairs)
    sparse = closed_path(settings.seed, SPARSE_PATH_SCANS).scans
    runs = tuple(
        Timing(
            c,
            _times(c, dense),
            _times(c, list(pairwise(sparse))),
        )
        for c in settings.contestants(order_extension=True)
    )
    return Report(
        name="timing",
        title="Time per pair",
        sections="§6.2",
        setup=(
            f"{pairs} pairs of consecutive scans, spread over the closed path of 3069 scans, and "
            f"all {SPARSE_PATH_SCANS - 1} of the path of 23; CPU time of this process on this "
            f"machine, after one pair to warm up; seed {settings.seed}.",
        ),
        matchers=tuple(r.contestant.label for r in runs),
        rows=_rows(runs),
        figures=(_figure(runs),),
        differences=_differences(runs),
        parameters={"seed": settings.seed, "quick": settings.quick, "pairs": pairs},
        figures_of={r.contestant.key: _figures(r) for r in runs},
    )


def _spread(recording: Recording, pairs: int) -> list[tuple[Any, Any]]:
    """Consecutive pairs at even distances over a recording."""
    first = np.linspace(0, len(recording) - 2, pairs).astype(np.int64).tolist()
    return [(recording.scans[i], recording.scans[i + 1]) for i in first]


def _times(contestant: Contestant, pairs: Sequence[tuple[Any, Any]]) -> Times:
    matcher = contestant.matcher
    matcher.match_prepared(matcher.prepare(pairs[0][0]), matcher.prepare(pairs[0][1]))
    prepare, match = [], []
    for reference, current in pairs:
        r, took_r = _timed(lambda scan=reference: matcher.prepare(scan))  # type: ignore[misc]
        c, took_c = _timed(lambda scan=current: matcher.prepare(scan))  # type: ignore[misc]
        _, took = _timed(lambda a=r, b=c: matcher.match_prepared(a, b))  # type: ignore[misc]
        prepare += [took_r, took_c]
        match.append(took)
    return Times(np.array(prepare), np.array(match))


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return what `work` returns and its CPU time [ms]."""
    start = time.process_time()
    outcome = work()
    return outcome, 1e3 * (time.process_time() - start)


def _figures(run: Timing) -> dict[str, float]:
    return {
        f"{path}_{name}": value
        for path, times in (("dense", run.dense), ("sparse", run.sparse))
        for name, value in (
            ("prepare_mean_ms", float(times.prepare.mean())),
            ("match_mean_ms", float(times.match.mean())),
            ("match_median_ms", float(np.median(times.match))),
            ("match_p99_ms", float(np.percentile(times.match, 99))),
            ("whole_mean_ms", times.whole),
        )
    }


def _rows(runs: tuple[Timing, ...]) -> tuple[Row, ...]:
    found = [_figures(run) for run in runs]

    def row(what: str, key: str, printed: str = "") -> Row:
        return Row(what, printed, tuple(f"{f[key]:.2f} ms" for f in found))

    return (
        row("3069 scans: extraction, per scan", "dense_prepare_mean_ms"),
        row("3069 scans: match alone, mean", "dense_match_mean_ms", f"{PRINTED_MS} ms"),
        row("3069 scans: match alone, median", "dense_match_median_ms"),
        row("3069 scans: match alone, 99 % below", "dense_match_p99_ms"),
        row("3069 scans: with both extractions", "dense_whole_mean_ms", f"{PRINTED_MS} ms"),
        row("23 scans: match alone, mean", "sparse_match_mean_ms"),
        row("23 scans: with both extractions", "sparse_whole_mean_ms"),
    )


def _figure(runs: tuple[Timing, ...]) -> Figure:
    series = [
        Series(
            r.contestant.label,
            _PERCENTILES,
            np.percentile(r.dense.match, _PERCENTILES),
            r.contestant.colour,
        )
        for r in runs
    ]
    ends, printed = np.array([0.0, 100.0]), np.array([PRINTED_MS, PRINTED_MS])
    series.append(Series(f"printed mean, {PRINTED_MS} ms", ends, printed, "#66727f"))
    chart = Chart("time of a match alone", "percentile of the pairs", "ms", tuple(series))
    text = "Percentiles of the matching time beside the printed mean."
    return Figure("timing", "Section 6.2: time per pair", text, ((chart,),), 400.0)


def _differences(runs: tuple[Timing, ...]) -> tuple[str, ...]:
    told = [
        f"The text does not say whether its {PRINTED_MS} ms include extraction, nor on which "
        "machine and in which language (of 2008 or before); both readings are in the table.",
    ]
    for run in runs:
        f = _figures(run)
        alone, whole = f["dense_match_mean_ms"], f["dense_whole_mean_ms"]
        told.append(
            f"The {run.contestant.label} takes {alone / PRINTED_MS:.2f} times the printed time for "
            f"a match alone and {whole / PRINTED_MS:.2f} times with both extractions; a scan that "
            f"is matched to the one before is extracted once, which makes "
            f"{alone + f['dense_prepare_mean_ms']:.2f} ms per new scan, "
            f"{'within' if alone + f['dense_prepare_mean_ms'] < SCAN_MS else 'beyond'} the "
            f"{SCAN_MS:g} ms of a sweep."
        )
        if run.contestant.key == "thesis":
            told.append(
                "The thesis's matcher is written in Python with numpy, to be read beside the text; "
                "the default matcher is compiled (numba)."
            )
    return tuple(told)
