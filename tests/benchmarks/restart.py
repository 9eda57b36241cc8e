"""`python -m tests.benchmarks.restart`: how long a killed service is away.

From the start of the process until it takes scans and shows the site's map as it was, once from the
snapshot and once, as the baseline, from the log alone.
"""

from __future__ import annotations

import os
import signal
import tempfile
import time
from itertools import islice
from pathlib import Path

from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom_lab.simulation import Fleet, Lidar, sick_lms200

from tests.benchmarks.environment import environment
from tests.benchmarks.row import Row, table
from tests.benchmarks.saved_sites import drop_snapshots, saved_bytes

SITE = "restarted"
ROBOTS = 4
_SETTINGS = {"LINELOOM_SNAPSHOT_IDLE_S": "0.5"}
_POLL_S = 0.02


def restarting(*, quick: bool) -> list[Row]:
    """A site of 5,000 scans after SIGKILL, with its snapshot and without."""
    count = 300 if quick else 5000
    with tempfile.TemporaryDirectory(prefix="lineloom-bench-") as name, environment(_SETTINGS):
        service = ChildService(Path(name))
        with service:
            version = drive(service, count, sick_lms200())
            saved_bytes(service.data_dir)
            kill(service)
        restored = seconds_away(service, version)
        drop_snapshots(service.data_dir)
        replayed = seconds_away(service, version)
    return [
        Row(
            name=f"restart after SIGKILL, a site of {count} scans, until its map is there",
            figure=restored,
            unit="s",
            better="lower",
            goal=10.0,
            baseline="from the log, without snapshots",
            baseline_figure=replayed,
            note="wall clock; kernels cached",
        )
    ]


def drive(service: ChildService, count: int, lidar: Lidar) -> int:
    """Post the drives of some robots; the version of the map that they made."""
    duration_s = 1.05 * count / (ROBOTS * lidar.rate_hz)
    fleet = Fleet.office(seed=4, robots=ROBOTS, duration_s=duration_s, lidar=lidar)
    seen = list(islice(fleet.scans(), count))
    assert len(seen) == count
    service.wait_until_ready()
    with Client(service.url) as client:
        for robot in fleet.robots:
            own = [one.scan for one in seen if one.robot == robot.name]
            client.post_scans(SITE, robot.name, own, batch=200)
        return client.wait_until_idle(SITE, 3600.0).version


def kill(service: ChildService) -> None:
    """End the service, and its workers, as a power cut would."""
    assert service.pid is not None
    os.killpg(service.pid, signal.SIGKILL)  # its workers as well


def seconds_away(service: ChildService, version: int, site: str = SITE) -> float:
    """Start, wait until all is as before, kill; how long that took."""
    begin = time.perf_counter()
    with service:
        service.wait_until_ready(600.0)
        with Client(service.url) as client:
            while client.map(site).version < version:
                time.sleep(_POLL_S)
        seconds = time.perf_counter() - begin
        kill(service)
    return seconds


if __name__ == "__main__":
    print(table(restarting(quick=False)))
