"""Whether the scans of a recording make sense, and whether a map comes of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median

from lineloom.cli.checkup import Finding, noted, ok, wrong
from lineloom.cli.failure import CommandError
from lineloom.cli.recordings import load
from lineloom.cli.schedule import Stream
from lineloom.wire import Scan

_LONGEST_INDOORS_M = 200.0
_MOST_MAPPED = 600
_APART = "not-joined"
_SURE = {
    "breaks",
    "clock-jump",
    "constant",
    "mirrored",
    "no-return-code",
    "odometry-units",
    "random",
    "stamp-units",
    "stuck",
    "tilted",
    "time-increment",
    "turn-scale",
}
"""Findings of the mapper's sensor doctor to be mended; so is what keeps a map from joining."""


def check_scans(path: Path) -> Iterator[Finding]:
    """Yield what is found in a file of scans, robot by robot."""
    try:
        streams = load([path])
    except CommandError as error:
        # It names line and field already.
        yield wrong("file", str(error), "mend or remove that line")
        return
    total = sum(len(stream.scans) for stream in streams)
    yield ok("file", f"{total} scans of {len(streams)} robot{'s' if len(streams) > 1 else ''}")
    for stream in streams:
        yield from _check_stream(stream)


def _check_stream(stream: Stream) -> Iterator[Finding]:
    name = f"{stream.robot}: "
    yield _beams(name + "beams", stream.scans)
    yield _units(name + "units", stream.scans)
    yield _clock(name + "clock", stream.scans)
    yield from _mapped(name, stream)


def _beams(check: str, scans: Sequence[Scan]) -> Finding:
    first = scans[0]
    counts = {len(scan.ranges) for scan in scans}
    increments = {round(scan.angle_increment, 9) for scan in scans}
    sweep = math.degrees(abs(first.angle_increment) * (len(first.ranges) - 1))
    found = f"{len(first.ranges)} beams over {sweep:.1f} degrees"
    if len(increments) > 1:
        return noted(check, f"{found}; the increment changes within the recording")
    if len(counts) > 1:
        return noted(check, f"{found}; the count changes: {min(counts)} to {max(counts)}")
    if sweep < 20.0:
        advice = "is angle_increment in radians? One degree is 0.01745"
        return wrong(check, found, advice)
    return ok(check, found)


def _units(check: str, scans: Sequence[Scan]) -> Finding:
    seen = [r for scan in scans[:: max(1, len(scans) // 50)] for r in _finite(scan)]
    if not seen:
        return wrong(check, "no beam has a range", "are null, 0 or inf all that the lidar sends?")
    middle, limit = median(seen), scans[0].range_max
    found = f"half of all ranges are under {middle:.2f} m, range_max is {limit:g}"
    if middle > _LONGEST_INDOORS_M:
        return wrong(check, found, "ranges are metres: divide millimetres by 1000")
    if middle < 0.02:
        return wrong(check, found, "ranges are metres: were they divided once too often?")
    return ok(check, found)


def _finite(scan: Scan) -> Iterator[float]:
    for value in scan.ranges:
        if isinstance(value, float | int) and scan.range_min <= value < scan.range_max:
            yield float(value)


def _clock(check: str, scans: Sequence[Scan]) -> Finding:
    steps = [b.stamp - a.stamp for a, b in pairwise(scans)]
    if not steps:
        return noted(check, "one scan only")
    back, still = sum(s < 0.0 for s in steps), sum(s == 0.0 for s in steps)
    rate = 1.0 / median(steps) if median(steps) > 0.0 else math.inf
    if still > len(steps) / 2:
        return wrong(check, f"{still} of {len(steps)} stamps stand still", "send the scans' times")
    if not 0.2 <= rate <= 200.0:
        advice = "stamps are seconds: are these milliseconds, or microseconds?"
        return wrong(check, f"{rate:.3g} scans a second", advice)
    if back:
        return noted(check, f"{rate:.1f} scans/s; {back} stamps step back")
    return ok(check, f"{rate:.1f} scans/s")


def _mapped(name: str, stream: Stream) -> Iterator[Finding]:
    """Map the first scans here, and see how that goes; silent where the core is not installed."""
    try:
        from lineloom.cli.trial_map import trial_map
    except ImportError:
        yield noted(f"{name}map", "not tried: the core is not installed here")
        return
    trial = trial_map(stream, _MOST_MAPPED)
    pieces = "one piece" if trial.parts == 1 else f"{trial.parts} pieces"
    found = f"{trial.placed} of the first {trial.scans} scans have a place, in {pieces}"
    if trial.placed < 0.8 * trial.scans:
        advice = "are the beams' angles and directions right? See the other findings"
        yield wrong(f"{name}map", found, advice)
    else:
        yield ok(f"{name}map", found)
    for finding in trial.health:
        what, _, message = finding.partition(": ")
        if what in _SURE or any(f.startswith(_APART) for f in trial.health):
            yield wrong(f"{name}sensor {what}", message, "mend it before this robot maps")
        else:
            yield noted(f"{name}sensor {what}", message)
