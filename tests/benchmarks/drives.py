"""Whole drives: the tracker, the mapper, and the mapper behind HTTP."""

from __future__ import annotations

import tempfile
from itertools import pairwise
from pathlib import Path
from time import perf_counter, process_time

from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom_core.features import extract_features
from lineloom_core.mapping.facts.tracker import Tracker
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.matching.interface import match
from lineloom_core.matching.local_map import Cloud
from lineloom_core.scan import Scan
from lineloom_lab.baselines import IdcMatcher

from tests.benchmarks.row import Row, median_seconds
from tests.benchmarks.scans import csail, driven_seconds

SITE = "bench"
BATCH = 50


def driving(data: Path, *, quick: bool, http: bool) -> list[Row]:
    """The CSAIL log through tracker, mapper and service; nothing without the data."""
    scans = csail(data, 300 if quick else None)
    if scans is None:
        return []
    in_process = _mapper_speed(scans)
    rows = [_tracker(scans), _mapper(in_process)]
    if http:
        rows.append(_http(scans, in_process))
    return rows


def _tracker(scans: list[Scan]) -> Row:
    tracker = Tracker()

    def follow(scan: Scan) -> object:
        features = extract_features(scan)
        return tracker.track(features, Cloud.of(features), scan.stamp)

    baseline = IdcMatcher()
    return Row.of_times(
        "tracker, per scan (CSAIL, 361 beams)",
        median_seconds(follow, scans),
        1.0,
        "IDC, scan to scan (scipy)",
        median_seconds(lambda pair: match(baseline, *pair), list(pairwise(scans[:100]))),
    )


def _mapper_speed(scans: list[Scan]) -> float:
    """Seconds of driving mapped per second of CPU time."""
    mapper = SiteMapper()
    begin = process_time()
    for scan in scans:
        mapper.add("robot", scan)
    mapper.view()
    return driven_seconds(scans) / (process_time() - begin)


def _mapper(speed: float) -> Row:
    return Row(
        name="CSAIL in process, whole mapper",
        figure=speed,
        unit="x real time",
        better="higher",
        goal=None,
        baseline="driving",
        baseline_figure=1.0,
    )


def _http(scans: list[Scan], in_process: float) -> Row:
    """From the first POST until the service says that all is in the map; wall clock."""
    with (
        tempfile.TemporaryDirectory(prefix="lineloom-bench-") as folder,
        ChildService(Path(folder)) as service,
        Client(service.url) as client,
    ):
        service.wait_until_ready()
        # A short drive on another site: its worker has loaded everything when the clock runs.
        client.post_scans("warm-up", "robot", scans[:100], batch=BATCH)
        client.wait_until_idle("warm-up", timeout=300.0)
        begin = perf_counter()
        client.post_scans(SITE, "robot", scans, batch=BATCH)
        client.wait_until_idle(SITE, timeout=600.0)
        elapsed = perf_counter() - begin
    return Row(
        name=f"CSAIL through HTTP (SDK, batches of {BATCH})",
        figure=driven_seconds(scans) / elapsed,
        unit="x real time",
        better="higher",
        goal=40.0,
        baseline="in process",
        baseline_figure=in_process,
        note="wall clock, server and client on the same cores",
    )
