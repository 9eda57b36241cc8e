"""The demo as a stranger runs it: a process of its own, and what it promises at the end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest


def start(tmp_path: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "lineloom.cli", "demo", *options]
    command += ["--out", str(tmp_path / "out"), "--data-dir", str(tmp_path / "data")]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.scenario
def test_robots_with_unknown_starts_end_in_one_map(tmp_path: Path) -> None:
    process = start(tmp_path, "--duration", "60", "--json")
    output, errors = process.communicate(timeout=300.0)
    assert process.returncode == 0, errors
    told = json.loads(output)
    pairs = [tuple(pair["robots"]) for pair in told["errors"]]
    names = ["robot-1", "robot-2", "robot-3"]
    assert pairs == [(names[0], names[1]), (names[0], names[2]), (names[1], names[2])]
    assert all(pair["rmse"] < 0.1 and pair["max"] < 0.5 for pair in told["errors"])
    assert (tmp_path / "out" / "map.svg").read_bytes().startswith((b"<svg", b"<?xml"))
    assert (tmp_path / "out" / "map.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.scenario
def test_robots_that_do_not_meet_are_a_failure(tmp_path: Path) -> None:
    process = start(tmp_path, "--duration", "10", "--lidar", "sick-lms200")
    _, errors = process.communicate(timeout=300.0)
    assert process.returncode == 4, errors
    assert "the robots did not come together: 3 components" in errors.splitlines()[-1]
    assert "Traceback" not in errors


@pytest.mark.scenario
def test_a_demo_that_is_stopped_leaves_no_service_behind(tmp_path: Path) -> None:
    process = start(tmp_path, "--duration", "10", "--lidar", "sick-lms200")
    try:
        log = tmp_path / "data" / "service.log"
        deadline = time.monotonic() + 120.0
        while not log.exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        assert log.exists()
        time.sleep(0.3)
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=300.0)
    finally:
        process.kill()
    assert process.returncode == 1
    assert not running(str(tmp_path / "data"))


def running(folder: str) -> list[int]:
    """Return the processes whose command line names the folder."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and folder in (entry / "cmdline").read_text():
                found.append(int(entry.name))
        except OSError:
            continue
    return [pid for pid in found if pid != os.getpid()]
