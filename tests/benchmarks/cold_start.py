"""`python -m tests.benchmarks.cold_start`: a first start, with nothing compiled, until it maps.

The baseline is how it was before kernels were compiled in parallel: one process that compiles each
as a drive comes to it. What else a start takes is not in it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom.errors import ConnectionFailedError
from lineloom.retry import RetryPolicy

from tests.benchmarks.environment import environment
from tests.benchmarks.row import Row, table

_ONE_PROCESS = "from lineloom_core.warm_up.drive import warm_up; assert warm_up()"
_POLL_S = 0.05


def starting() -> list[Row]:
    """A source tree's first start, and its second."""
    with tempfile.TemporaryDirectory(prefix="lineloom-bench-") as name:
        folder = Path(name)
        with environment({"LINELOOM_KERNEL_CACHE": str(folder / "kernels")}):
            takes_scans, maps = _start(folder / "first")
            _, again = _start(folder / "second")
        with environment({"LINELOOM_KERNEL_CACHE": str(folder / "at-once")}):
            at_once = _seconds_in_one_process()
    baseline = "compiled at once by one process, without the service's start"
    note = f"wall clock, {os.cpu_count()} cores, {os.environ.get('LINELOOM_KERNELS', 'auto')}"
    rows = [
        ("first start, until scans are taken", takes_scans, None),
        ("first start of a source tree, until they are mapped", maps, at_once / 2.0),
        ("a start with all in the cache, until they are mapped", again, 10.0),
    ]
    return [
        Row(what, figure, "s", "lower", goal, baseline, at_once, note)
        for what, figure, goal in rows
    ]


def _start(data: Path) -> tuple[float, float]:
    """Seconds from the start of a service until it takes scans, and until it maps them."""
    begin = time.perf_counter()
    takes_scans = 0.0
    service = ChildService(data)
    with service, Client(service.url, retry=RetryPolicy(attempts=1)) as client:
        while True:
            try:
                state = client.ready()
            except ConnectionFailedError:
                time.sleep(_POLL_S)
                continue
            if state.takes_scans and not takes_scans:
                takes_scans = time.perf_counter() - begin
            if state.maps:
                return takes_scans, time.perf_counter() - begin
            time.sleep(_POLL_S)


def _seconds_in_one_process() -> float:
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", _ONE_PROCESS], check=True)
    return time.perf_counter() - begin


if __name__ == "__main__":
    print(table(starting()))
