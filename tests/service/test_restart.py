"""After a restart the service is ready when it answers as it did before, and not earlier."""

from __future__ import annotations

import os
import signal
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest
from lineloom import Client

from tests.service.fake_server import free_port, server
from tests.service.zygote import Forked

SNAPSHOT_EVERY = 100
"""As `serve_fake.py` has it."""

SLOW = {"FAKE_MAPPER_SECONDS": "0.01"}


def _scans(seqs: range) -> list[dict[str, Any]]:
    return [
        {
            "seq": seq,
            "stamp": float(seq),
            "angle_min": -1.0,
            "angle_increment": 0.5,
            "range_min": 0.1,
            "range_max": 30.0,
            "ranges": [1.0, 2.0, 3.0, 4.0, 5.0],
        }
        for seq in seqs
    ]


def _saved(directory: Path) -> int:
    """Return the position of the site's latest snapshot."""
    with closing(sqlite3.connect(directory / "lineloom.db")) as connection:
        (position,) = connection.execute("SELECT max(position) FROM snapshots").fetchone()
    return position or 0


def _kill(process: Forked) -> None:
    process.kill()
    process.wait()


def _end(process: Forked) -> None:
    process.terminate()
    assert process.wait(60) == 0


def _end_all(process: Forked) -> None:
    """As systemd does: SIGTERM to every process of the unit."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    assert children
    for child in children:
        os.kill(int(child), signal.SIGTERM)
    time.sleep(0.2)  # the worst order: the workers first
    _end(process)


@pytest.mark.parametrize(
    ("scans", "stop", "saved"),
    [
        pytest.param(80, _kill, 0, id="killed-before-the-first-snapshot"),
        pytest.param(130, _kill, 100, id="killed-with-some-not-saved"),
        pytest.param(80, _end, 80, id="ended"),
        pytest.param(80, _end_all, 80, id="ended-with-its-workers"),
    ],
)
def test_ready_is_said_with_the_map_of_before(
    tmp_path: Path, scans: int, stop: Callable[[Forked], None], saved: int
) -> None:
    port = free_port()
    with Client(f"http://127.0.0.1:{port}") as client:
        with server(tmp_path, port) as process:
            for start in range(0, scans, SNAPSHOT_EVERY):
                client.post_scans("s", "r", _scans(range(start, min(scans, start + 100))))
                before = client.wait_until_idle("s")
                _until(lambda end=start + 100: end > scans or _saved(tmp_path) == end)  # type: ignore[misc]
            _until(lambda: _recorded(tmp_path) == scans)
            stop(process)
        assert _saved(tmp_path) == saved
        with server(tmp_path, port, **SLOW):
            reasons = _reasons_until_ready(port)
            after = client.site("s")
            # Where it was killed as it told that it had settled, it has to settle again.
            assert client.wait_until_idle("s").version == before.version
    assert (after.version, after.scans.processed, after.scans.pending) == (before.version, scans, 0)
    if saved < scans:
        assert any(f"site s is being resumed: entry {saved} of {scans}" in r for r in reasons)


def _recorded(directory: Path) -> int:
    with closing(sqlite3.connect(directory / "lineloom.db")) as connection:
        (position,) = connection.execute("SELECT max(position) FROM events").fetchone()
    return position or 0


def _until(done: Callable[[], bool]) -> None:
    for _ in range(3000):
        if done():
            return
        time.sleep(0.02)
    raise AssertionError("never happened")


def _reasons_until_ready(port: int) -> set[str]:
    reasons: set[str] = set()
    with httpx.Client(trust_env=False, verify=False) as client:
        for _ in range(12_000):
            answer = client.get(f"http://127.0.0.1:{port}/readyz?maps=true")
            if answer.status_code == 200:
                return reasons
            assert answer.status_code == 503
            reasons.update(answer.json()["reasons"])
            time.sleep(0.005)
    raise AssertionError(f"never ready: {reasons}")


def test_what_an_operator_said_is_there_after_a_kill(tmp_path: Path) -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}/v1/sites/s"
    said = {"robot_a": "a", "robot_b": "b", "T_a_b": {"x": 0.5, "y": 0.25, "theta": 0.1}}
    with server(tmp_path, port) as process:
        for robot in ("a", "b"):
            httpx.post(f"{url}/robots/{robot}/scans", json={"scans": _scans(range(5))})
        with Client(f"http://127.0.0.1:{port}") as client:
            client.wait_until_idle("s", 30.0)
        made = httpx.post(f"{url}/constraints", json=said)
        assert made.status_code == 201
        name = made.json()["id"]
        before = httpx.get(f"{url}/map").json()["lines"]
        _kill(process)
    with server(tmp_path, port) as process, Client(f"http://127.0.0.1:{port}") as client:
        client.wait_until_idle("s", 30.0)
        found = httpx.get(f"{url}/constraints", params={"kind": "operator"}).json()["constraints"]
        assert [(c["id"], c["state"]) for c in found] == [(name, "accepted")]
        assert httpx.get(f"{url}/map").json()["lines"] == before
        _end(process)
