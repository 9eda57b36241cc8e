"""Real buildings as a user would map them: the command line, a real service, the SDK."""

from __future__ import annotations

import json
import subprocess
import sys
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom.cli.recordings import load

from tests.scenarios.real_logs import CSAIL, FR079, RealLog

pytestmark = pytest.mark.scenario


def replay(log: RealLog, url: str, site: str) -> dict[str, Any]:
    """`lineloom replay LOG --split 3 --no-odometry`; its figures."""
    command = [sys.executable, "-m", "lineloom.cli", "replay", str(log.log)]
    options = ["--split", "3", "--no-odometry", "--site", site, "--url", url, "--json"]
    done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures: dict[str, Any] = json.loads(done.stdout)
    return figures


@pytest.mark.parametrize("log", [CSAIL, FR079], ids=lambda log: log.name)
def test_a_replayed_log_becomes_one_right_map(log: RealLog, tmp_path: Path) -> None:
    log.require()
    streams = load([log.log], split_into=3, odometry=False)
    first_row = accumulate((len(s.scans) for s in streams), initial=0)
    with ChildService(tmp_path / "data") as service:
        service.wait_until_ready()
        figures = replay(log, service.url, "building")
        assert (figures["accepted"], figures["rejected"]) == (log.scans, 0)
        names = sorted(s.robot for s in streams)
        assert [sorted(robots) for robots in figures["components"]] == [names]
        rows, poses = [], []
        with Client(service.url) as client:
            for stream, offset in zip(streams, first_row, strict=False):
                for pose in client.trajectory("building", stream.robot).poses:
                    rows.append(offset + pose.seq)
                    poses.append((pose.x, pose.y, pose.theta))
            state = client.site("building")
            assert (state.idle, state.scans.pending) == (True, 0)
            found = client.map("building")
            picture = client.map_file("building", "svg")
    log.check(np.array(rows), np.array(poses))
    assert sum(np.hypot(w.x2 - w.x1, w.y2 - w.y1) for w in found.lines if w.support >= 10) > 150.0
    assert len(picture) > 10_000
