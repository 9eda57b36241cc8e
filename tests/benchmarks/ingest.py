"""Durable scans a second through HTTP: what `202` costs, and what sharing commits saves."""

from __future__ import annotations

import asyncio
import json
import os
import tempfile
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import uvloop
from lineloom.cli.child_service import ChildService

from tests.benchmarks.environment import environment
from tests.benchmarks.post_load import Load, post_all, request
from tests.benchmarks.row import Row

BEAMS = 361
CONNECTIONS = 32
BATCH = 100
ROBOTS = 8

JSON, MSGPACK = "application/json", "application/msgpack"

# Nothing is mapped: two cores are for the server and this client. All is taken.
_ALONE = {"LINELOOM_ENGINE": "off", "LINELOOM_BACKLOG_LIMIT": "100000000"}


def ingesting(*, quick: bool) -> list[Row]:
    """Single scans as msgpack and JSON, and batches, each beside one commit per POST."""
    count = 300 if quick else 6000
    together = _Service(_ALONE)
    apart = _Service({**_ALONE, "LINELOOM_GROUP_LIMIT": "1"})
    mapped = _Service({"LINELOOM_BACKLOG_LIMIT": "100000000"})
    singles = "scans of 361 beams, one a POST"
    return [
        _row(f"durable {singles}, msgpack", 1500.0, together, apart, MSGPACK, count, 1),
        _row(f"durable {singles}, JSON", 800.0, together, apart, JSON, count, 1),
        _row(f"durable {singles}, mapped meanwhile", None, mapped, apart, MSGPACK, count, 1),
        _row(
            f"durable scans, {BATCH} a POST, msgpack",
            5000.0,
            together,
            apart,
            MSGPACK,
            4 * count,
            BATCH,
        ),
    ]


class _Service:
    """`lineloom serve` with some settings, run anew for each figure."""

    def __init__(self, settings: dict[str, str]) -> None:
        self._settings = settings

    def measure(self, content_type: str, scans: int, batch: int) -> tuple[float, float]:
        """Return acknowledged scans a second, and the server's CPU time a scan [µs]."""
        with (
            tempfile.TemporaryDirectory(prefix="lineloom-bench-") as folder,
            environment(self._settings),
            ChildService(Path(folder)) as service,
        ):
            service.wait_until_ready()
            _post(service.port, _requests("warm-up", content_type, 64 * batch, batch))
            assert service.pid is not None
            before = _cpu_seconds(service.pid)
            load = _post(service.port, _requests("bench", content_type, scans, batch))
            cpu = _cpu_seconds(service.pid) - before
        if load.refused:
            raise RuntimeError(f"{load.refused} of {load.posts} POSTs were refused")
        return scans / load.seconds, 1e6 * cpu / scans


def _row(
    name: str,
    goal: float | None,
    service: _Service,
    baseline: _Service,
    content_type: str,
    scans: int,
    batch: int,
) -> Row:
    speed, cpu = service.measure(content_type, scans, batch)
    slow, _ = baseline.measure(content_type, scans // 4, batch)
    return Row(
        name=f"{name}, {CONNECTIONS} connections",
        figure=speed,
        unit="scans/s",
        better="higher",
        goal=goal,
        baseline="one commit per POST",
        baseline_figure=slow,
        note=f"wall clock; {cpu:.0f} µs of the server's CPU time a scan",
    )


def _post(port: int, requests: list[bytes]) -> Load:
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        return runner.run(post_all("127.0.0.1", port, requests, CONNECTIONS))


def _requests(site: str, content_type: str, scans: int, batch: int) -> list[bytes]:
    rng = np.random.default_rng(11)
    ranges = rng.uniform(0.5, 20.0, (64, BEAMS)).astype(np.float32)
    requests = []
    for number in range(scans // batch):
        robot = f"r{number % ROBOTS}"
        first = number // ROBOTS * batch
        members = [_scan(ranges[(number + k) % 64], first + k, content_type) for k in range(batch)]
        body = members[0] if batch == 1 else {"scans": members}
        packed = msgpack.packb(body) if content_type == MSGPACK else json.dumps(body).encode()
        path = f"/v1/sites/{site}/robots/{robot}/scans"
        requests.append(request(path, content_type, packed))
    return requests


def _scan(ranges: np.ndarray[Any, np.dtype[np.float32]], seq: int, kind: str) -> dict[str, Any]:
    return {
        "seq": seq,
        "stamp": 0.1 * seq,
        "angle_min": -np.pi / 2,
        "angle_increment": np.pi / (BEAMS - 1),
        "range_min": 0.05,
        "range_max": 30.0,
        # Centimetres, as drivers print them.
        "ranges": ranges.tobytes() if kind == MSGPACK else [round(float(r), 3) for r in ranges],
    }


def _cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
