"""`python -m tests.benchmarks.site_sizes`: what a site of a given size costs, as a table.

One service with one worker for each row, on a made-up office floor that four robots drive through.
The CPU time is the machine's own; the rest is the same everywhere. `--scans` and `--lidars` choose
the rows; a row of n scans takes about n / 100 seconds.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom_lab.simulation import Lidar, scanner_360, sick_lms200

from tests.benchmarks.environment import environment
from tests.benchmarks.restart import SITE, drive, seconds_away
from tests.benchmarks.saved_sites import log_bytes, saved_bytes
from tests.benchmarks.soak_watch import look

LIDARS = {"sick-lms200": sick_lms200, "scanner-360": scanner_360}
SCANS = (1000, 5000, 10000)
_SETTINGS = {"LINELOOM_SNAPSHOT_IDLE_S": "0.5", "LINELOOM_WORKERS": "1"}
_TICKS = os.sysconf("SC_CLK_TCK")
_KIB, _MIB = 1024.0, 1024.0**2
HEAD = (
    "| scans | beams | keyframes | lines | worker's memory | of it per keyframe "
    "| CPU per scan | disk per scan | snapshot | restart, stopped | restart, killed |\n"
    "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
)


@dataclass(frozen=True, slots=True)
class SiteSize:
    """What one site costs.

    grown_bytes: by which its worker grew. log_bytes: on disk, without snapshots. cpu_s: of all
    the service's processes, while it took and mapped the scans. stopped_s, killed_s: from the start
    of the process until the map is there as it was.
    """

    scans: int
    beams: int
    keyframes: int
    lines: int
    worker_bytes: int
    grown_bytes: int
    cpu_s: float
    log_bytes: int
    snapshot_bytes: int
    stopped_s: float
    killed_s: float

    def row(self) -> str:
        """As a row of the table."""
        cells = (
            f"{self.scans:,}",
            f"{self.beams}",
            f"{self.keyframes:,}",
            f"{self.lines:,}",
            f"{self.worker_bytes / _MIB:.0f} MiB",
            f"{self.grown_bytes / max(self.keyframes, 1) / _KIB:.0f} KiB",
            f"{1e3 * self.cpu_s / self.scans:.1f} ms",
            f"{self.log_bytes / self.scans / _KIB:.1f} KiB",
            f"{self.snapshot_bytes / _MIB:.1f} MiB",
            f"{self.stopped_s:.1f} s",
            f"{self.killed_s:.1f} s",
        )
        return f"| {' | '.join(cells)} |"


def measure(count: int, lidar: Lidar) -> SiteSize:
    """Map a site of so many scans, and restart its service."""
    with tempfile.TemporaryDirectory(prefix="lineloom-bench-") as name, environment(_SETTINGS):
        service = ChildService(Path(name))
        with service, Client(service.url) as client:
            service.wait_until_ready()
            before, idle_s = _worker_bytes(service), _cpu_s(service)
            version = drive(service, count, lidar)
            cpu_s = _cpu_s(service) - idle_s
            snapshot = saved_bytes(service.data_dir)
            after = _worker_bytes(service)
            keyframes = sum(robot.keyframes for robot in client.robots(SITE).robots)
            lines = len(client.map(SITE).lines)
        kept = log_bytes(service.data_dir)
        stopped_s = seconds_away(service, version)
        return SiteSize(
            count,
            lidar.beams,
            keyframes,
            lines,
            after,
            after - before,
            cpu_s,
            kept,
            snapshot,
            stopped_s,
            seconds_away(service, version),
        )


def _worker_bytes(service: ChildService) -> int:
    assert service.pid is not None
    return look("", service.pid, 0, 0).rss_bytes["worker 1"]


def _cpu_s(service: ChildService) -> float:
    """CPU time of the service and its worker so far."""
    children = Path(f"/proc/{service.pid}/task/{service.pid}/children").read_text().split()
    return sum(_process_cpu_s(pid) for pid in (str(service.pid), *children))


def _process_cpu_s(pid: str) -> float:
    # What comes before the last bracket is the program's name, which may hold anything.
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, nargs="+", default=SCANS, help="sizes of the sites")
    parser.add_argument("--lidars", nargs="+", choices=LIDARS, default=list(LIDARS))
    options = parser.parse_args()
    begin = time.monotonic()
    print(HEAD, flush=True)
    for name in options.lidars:
        for count in options.scans:
            print(measure(count, LIDARS[name]()).row(), flush=True)
    minutes = (time.monotonic() - begin) / 60.0
    print(f"\n{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, {minutes:.0f} minutes.")


if __name__ == "__main__":
    main()
