"""`python -m tests.benchmarks.soak [--share S | --full]`: does memory stay bounded under load?

An hour of 20 robots, or the share of it that is named, sent as fast as the service takes it: the
backlog is full most of the time. Listeners to events that never read hang on it meanwhile. Half of
it is sent, then as much again: by then the building is known, and memory should hardly grow.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from itertools import islice, pairwise
from pathlib import Path

from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom.retry import RetryPolicy
from lineloom_core.scan import Scan
from lineloom_lab.simulation import Fleet, sick_lms200

from tests.benchmarks.environment import environment
from tests.benchmarks.restart import seconds_away
from tests.benchmarks.row import Row, table
from tests.benchmarks.saved_sites import saved_bytes
from tests.benchmarks.soak_watch import Moment, SlowReaders, Watch, look

SITE = "soaked"
ROBOTS = 20
HOUR_S = 3600.0
SHARE, QUICK_SHARE = 0.05, 0.005
_SETTINGS = {
    "LINELOOM_BACKLOG_LIMIT": "2000",
    "LINELOOM_SLOW_READER_S": "5",
    "LINELOOM_SNAPSHOT_IDLE_S": "0.5",
}
_READERS = 8
_PAGE_BYTES = 4096
_SECONDS_A_POST = 2
_PATIENT = RetryPolicy(attempts=1000, max_delay=1.0, seed=1)

Posts = Iterator[tuple[str, list[Scan]]]


def soaking(share: float) -> list[Row]:
    """What each process grew by; a report of all that was seen goes to stderr."""
    fleet = Fleet.office(seed=4, robots=ROBOTS, duration_s=share * HOUR_S, lidar=sick_lms200())
    posts = _posts(fleet)
    half = int(share * HOUR_S / _SECONDS_A_POST) * ROBOTS // 2
    with tempfile.TemporaryDirectory(prefix="lineloom-bench-") as name, environment(_SETTINGS):
        service = ChildService(Path(name))
        with service, Client(service.url, retry=_PATIENT) as client:
            service.wait_until_ready()
            assert service.pid is not None
            moments = [look("start", service.pid, 0, 0)]
            _send(client, islice(posts, ROBOTS))
            with SlowReaders(service.port, SITE, _READERS), Watch(service.url, SITE) as watch:
                for when, part in (("middle", islice(posts, half - ROBOTS)), ("end", posts)):
                    _send(client, part)
                    client.wait_until_idle(SITE, timeout=7200.0)
                    saved = saved_bytes(service.data_dir)
                    moments.append(look(when, service.pid, watch.keyframes(), saved))
                dropped = _READERS - watch.listeners()
                refused = watch.refused()
            version = client.map(SITE).version
        away_s = seconds_away(service, version, SITE)
    report = _report(moments, watch.highest_backlog, refused, dropped)
    print(report, file=sys.stderr)  # stdout is for the rows
    note = f"backlog to {watch.highest_backlog}, {refused} refused"
    return [*_rows(moments, note), _restart(away_s, share)]


def _posts(fleet: Fleet) -> Posts:
    """What each robot saw in some seconds, in the order of time; simulated only when asked for."""
    window: dict[str, list[Scan]] = defaultdict(list)
    end_s = float(_SECONDS_A_POST)
    for seen in fleet.scans():
        if seen.time_s >= end_s:
            yield from window.items()
            window.clear()
            end_s += _SECONDS_A_POST
        window[seen.robot].append(seen.scan)
    yield from window.items()


def _send(client: Client, posts: Posts) -> None:
    for robot, scans in posts:
        client.post_scans(SITE, robot, scans)


def _report(moments: list[Moment], backlog: int, refused: int, dropped: int) -> str:
    lines = [f"{'MB':8}" + "".join(f"{moment.when:>10}" for moment in moments)]
    lines.append(f"{'saved':8}" + "".join(f"{m.saved_bytes / 1e6:10.1f}" for m in moments))
    for process in moments[0].rss_bytes:
        figures = (f"{m.rss_bytes[process] / 1e6:10.1f}" for m in moments)
        lines.append(f"{process:8}" + "".join(figures))
    lines.append(f"{'keyframe':8}" + "".join(f"{m.keyframes:10}" for m in moments))
    lines.append(f"backlog at most {backlog}, POSTs refused {refused} (sent again)")
    lines.append(f"listeners that never read: {dropped} of {_READERS} dropped")
    return "\n".join(lines)


def _rows(moments: list[Moment], note: str) -> list[Row]:
    """The goal: as many scans again, and memory grows by at most half of what it did before.

    The map stops growing with its building; what is kept of every scan is little.
    """
    first, second = (_grown(*pair) for pair in pairwise(moments))
    return [
        Row(
            name=f"soak, {ROBOTS} robots: memory that {process} grew by, second half",
            figure=second[process],
            unit="MB",
            better="lower",
            goal=0.5 * first[process],
            baseline="first half, from the start on",
            baseline_figure=first[process],
            note=note,
        )
        for process in moments[0].rss_bytes
    ]


def _restart(away_s: float, share: float) -> Row:
    return Row(
        name="soak: restart, until the map is there as it was",
        figure=away_s,
        unit="s",
        better="lower",
        goal=10.0,
        baseline="the drive",
        baseline_figure=share * HOUR_S,
        note="wall clock; kernels cached",
    )


def _grown(before: Moment, after: Moment) -> dict[str, float]:
    """What each process grew by [MB]; at least a page."""
    grown = {name: rss - before.rss_bytes[name] for name, rss in after.rss_bytes.items()}
    return {name: 1e-6 * max(size, _PAGE_BYTES) for name, size in grown.items()}


def main() -> None:
    """Soak and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=SHARE, help="of the hour, up to 1")
    parser.add_argument("--full", action="store_true", help="the whole hour")
    options = parser.parse_args()
    print(table(soaking(1.0 if options.full else options.share)))


if __name__ == "__main__":
    main()
