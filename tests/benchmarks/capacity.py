"""`python -m tests.benchmarks.capacity`: how many robots this machine maps in real time.

Simulated robots on an office floor send at their own pace, `--robots` of them in all, spread over
`--sites`; a row for each number. It is kept up with where no scan is refused and the backlog, from
the second fifth of the time to the last, grows by less than a second's scans. The first number that
is not ends a column. Five minutes a row: `--seconds` makes it shorter, and says less.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean, quantiles

import httpx
from lineloom.cli.child_service import ChildService

from tests.benchmarks.paced_fleet import PacedFleet, Post, drives
from tests.benchmarks.soak_watch import look

ROBOTS = (5, 10, 20, 40, 60, 100)
_EVERY_S = 0.25
HEAD = (
    "| robots | sites | scans/s | keeps up | backlog, second and last fifth | map delay p50 "
    "| p99 | GET map p99 | GET robot p99 | memory |\n"
    "| ---: | ---: | ---: | :---: | ---: | ---: | ---: | ---: | ---: | ---: |"
)


@dataclass
class Looks:
    """What somebody saw who looked again and again.

    pending: of all sites, at each look. delays: how long ago the first scan that is not in the map
    was sent. maps, robots: how long the answers took [s].
    """

    pending: list[int] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)
    maps: list[float] = field(default_factory=list)
    robots: list[float] = field(default_factory=list)

    def fifth(self, number: int) -> float:
        """Mean backlog in one fifth of the time."""
        share = max(len(self.pending) // 5, 1)
        return mean(self.pending[number * share : (number + 1) * share] or [0])


@dataclass(frozen=True, slots=True)
class Trial:
    """Whether so many robots are kept up with, and what it is like."""

    robots: int
    sites: int
    scans_per_s: float
    refused: int
    looks: Looks
    rss_bytes: int

    @property
    def keeps_up(self) -> bool:
        """Whether the backlog does not grow, and nothing was refused."""
        grown = self.looks.fifth(4) - self.looks.fifth(1)
        return self.refused == 0 and grown < self.scans_per_s

    def row(self) -> str:
        """As a row of the table."""
        looks = self.looks
        cells = (
            f"{self.robots}",
            f"{self.sites}",
            f"{self.scans_per_s:.0f}",
            "yes" if self.keeps_up else "no",
            f"{looks.fifth(1):.0f}, {looks.fifth(4):.0f}",
            f"{percentile(looks.delays, 50):.2f} s",
            f"{percentile(looks.delays, 99):.2f} s",
            f"{1e3 * percentile(looks.maps, 99):.0f} ms",
            f"{1e3 * percentile(looks.robots, 99):.0f} ms",
            f"{self.rss_bytes / 1e6:.0f} MB",
        )
        return f"| {' | '.join(cells)} |"


def percentile(values: Sequence[float], percent: int) -> float:
    """Return a percentile; of one value or none that, or nought."""
    if len(values) < 2:
        return values[0] if values else 0.0
    return quantiles(values, n=100, method="inclusive")[percent - 1]


def measure(robots: int, sites: int, seconds: float, sent: list[list[Post]], rate: float) -> Trial:
    """Have so many robots drive in so many sites, each of which has the same building."""
    each = [sent[: robots // sites + (k < robots % sites)] for k in range(sites)]
    with tempfile.TemporaryDirectory(prefix="lineloom-bench-") as name:
        service = ChildService(Path(name))
        with service, httpx.Client(base_url=service.url, timeout=120.0) as http:
            service.wait_until_ready()
            fleet = PacedFleet(service.port, {f"site-{k}": own for k, own in enumerate(each)})
            with fleet:
                looks = _look_on(http, fleet, seconds)
            assert service.pid is not None
            rss = sum(look("end", service.pid, 0, 0).rss_bytes.values())
        refused = sum(count for status, count in fleet.answers.items() if status != 202)
        return Trial(robots, sites, robots * rate, refused, looks, rss)


def _look_on(http: httpx.Client, fleet: PacedFleet, seconds: float) -> Looks:
    looks, end = Looks(), time.monotonic() + seconds
    sites = list(fleet.sites)
    turn = 0
    while time.monotonic() < end:
        pause = time.monotonic() + _EVERY_S
        known = json.loads(http.get("/v1/sites").content)["sites"]
        looks.pending.append(sum(site["scans"]["pending"] for site in known))
        site, turn = sites[turn % len(sites)], turn + 1
        if any(one["site"] == site for one in known):
            _look_at(http, fleet, site, looks)
        time.sleep(max(0.0, pause - time.monotonic()))
    return looks


def _look_at(http: httpx.Client, fleet: PacedFleet, site: str, looks: Looks) -> None:
    robots = json.loads(http.get(f"/v1/sites/{site}/robots").content)["robots"]
    now = time.monotonic()
    for robot in robots:
        age = fleet.age_s(site, robot["robot"], robot["latest_seq"], now)
        looks.delays += [] if age is None else [age]
    for path, times in (("robots/robot-0", looks.robots), ("map", looks.maps)):
        begin = time.perf_counter()
        http.get(f"/v1/sites/{site}/{path}")
        times.append(time.perf_counter() - begin)


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, nargs="+", default=ROBOTS, help="in all, ascending")
    parser.add_argument("--sites", type=int, nargs="+", default=(1, 10), help="that they are in")
    parser.add_argument("--seconds", type=float, default=300.0, help="of driving, each row")
    parser.add_argument("--rate", type=float, default=10.0, help="scans a second of each robot")
    parser.add_argument("--beams", type=int, default=360, help="of each scan, all around")
    parser.add_argument("--batch", type=int, default=5, help="scans in a POST")
    parser.add_argument("--all", action="store_true", help="go on past what is not kept up with")
    options = parser.parse_args()
    print(HEAD, flush=True)
    for sites in options.sites:
        for robots in options.robots:
            if robots < sites:
                continue
            sent = drives(
                -(-robots // sites),
                rate_hz=options.rate,
                seconds=options.seconds,
                beams=options.beams,
                batch=options.batch,
            )
            trial = measure(robots, sites, options.seconds, sent, options.rate)
            print(trial.row(), flush=True)
            if not (trial.keeps_up or options.all):
                break
    print(f"\n{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; senders on the same cores.")


if __name__ == "__main__":
    main()
