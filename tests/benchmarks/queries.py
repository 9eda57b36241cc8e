"""Queries while robots flood the service: nobody who looks at a map waits for the mapping."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import quantiles

import httpx
from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom_core.scan import Scan

from tests.benchmarks.row import Row

SITE = "looked-at"
CONNECTIONS = 32
BATCH = 200
_PAUSE_S = 0.01


def queries(scans: list[Scan], *, quick: bool) -> list[Row]:
    """`GET map` of a real drive: p50 of an idle service, p99 while another site is flooded.

    In the second row it is the flooded site's own map that is looked at: it changes all the time.
    """
    seconds = 2.0 if quick else 20.0
    with (
        tempfile.TemporaryDirectory(prefix="lineloom-bench-") as folder,
        ChildService(Path(folder)) as service,
        Client(service.url) as client,
    ):
        service.wait_until_ready()
        client.post_scans(SITE, "robot", scans, batch=BATCH)
        client.wait_until_idle(SITE, timeout=600.0)
        idle = _percentile(_times(service.url, SITE, seconds), 50)
        with _flooded(service, "flooded"):
            other = _percentile(_times(service.url, SITE, seconds), 99)
        with _flooded(service, SITE):
            own = _percentile(_times(service.url, SITE, seconds), 99)
    return [_row("another site flooded", other, idle), _row("this site flooded", own, idle)]


def _row(when: str, p99: float, idle: float) -> Row:
    return Row.of_times(
        f"GET map, p99, {when} ({CONNECTIONS} connections)",
        p99,
        5e3 * idle,
        "the same, p50, idle",
        idle,
        "wall clock; service, flood and the one who looks on the same cores",
    )


@contextmanager
def _flooded(service: ChildService, site: str) -> Iterator[None]:
    command = [sys.executable, "-m", "tests.benchmarks.flood", "127.0.0.1", str(service.port)]
    command += [site, str(CONNECTIONS)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as flood:
        try:
            assert flood.stdout is not None
            while flood.stdout.readline().split()[1:] in ([], ["0", "0"]):
                assert flood.poll() is None, "the flood ended"
            yield
        finally:
            flood.kill()


def _times(url: str, site: str, seconds: float) -> list[float]:
    """How long each of many requests took, one after another on one connection."""
    times: list[float] = []
    end = time.monotonic() + seconds
    with httpx.Client(base_url=url, timeout=30.0) as http:
        http.get(f"/v1/sites/{site}/map").raise_for_status()
        while time.monotonic() < end:
            begin = time.perf_counter()
            http.get(f"/v1/sites/{site}/map").raise_for_status()
            times.append(time.perf_counter() - begin)
            time.sleep(_PAUSE_S)
    return times


def _percentile(times: list[float], percent: int) -> float:
    return quantiles(times, n=100, method="inclusive")[percent - 1]
