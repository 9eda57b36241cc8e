"""Scans and pairs of scans: extraction and matching."""

from __future__ import annotations

from pathlib import Path

from lineloom_core.features import ExtractionConfig, extract_features
from lineloom_core.matching import LineMatcher
from lineloom_core.matching.interface import match
from lineloom_core.scan import Scan
from lineloom_lab.baselines import AngleHistogramMatcher
from lineloom_lab.simulation import Lidar, scanner_360, sick_lms200

from tests.benchmarks.row import Row, median_seconds
from tests.benchmarks.scans import ScanPair, office_pairs, office_scans, real_pairs
from tests.core.features import slow_twins


def extraction(*, quick: bool) -> list[Row]:
    """Feature extraction against its slow and obvious twin."""
    count = 20 if quick else 200
    return [
        _extraction(sick_lms200(), count, goal=60.0),
        _extraction(scanner_360(), count, goal=None),
    ]


def _extraction(lidar: Lidar, count: int, goal: float | None) -> Row:
    scans = office_scans(lidar, count)

    def twin(scan: Scan) -> object:
        return slow_twins.extract(
            scan.ranges, scan.angle_min, scan.angle_increment, ExtractionConfig()
        )

    return Row(
        name=f"features, {lidar.beams} beams",
        figure=1e6 * median_seconds(extract_features, scans, repeats=20),
        unit="µs",
        better="lower",
        goal=goal,
        baseline="slow twin (numpy and Python)",
        baseline_figure=1e6 * median_seconds(twin, scans[:20]),
    )


def matching(data: Path, *, quick: bool) -> list[Row]:
    """A pose-free match, extraction of both scans included."""
    rows = [_matching("pair, simulated, 181 beams", office_pairs(40 if quick else 200))]
    real = real_pairs(data, every=40 if quick else 4)
    if real is not None:
        rows.append(_matching("pair, real, 360 beams", real))
    return rows


def _matching(name: str, pairs: list[ScanPair]) -> Row:
    matcher, baseline = LineMatcher(), AngleHistogramMatcher()
    return Row.of_times(
        name,
        median_seconds(lambda pair: matcher.match(*pair), pairs, repeats=3),
        0.4,
        "angle histograms (Weiss 1994, numpy)",
        median_seconds(lambda pair: match(baseline, *pair), pairs[:50]),
    )
