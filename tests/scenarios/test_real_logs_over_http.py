"""Real buildings as a user would map them: the command line, a real service, the SDK."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from itertools import accumulate
from typing import Any

import numpy as np
import pytest
from lineloom import Client
from lineloom.cli.child_service import ChildService
from lineloom.cli.recordings import load

from tests.scenarios.real_logs import CSAIL, FR079, RealLog

pytestmark = pytest.mark.scenario


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ChildService]:
    with ChildService(tmp_path_factory.mktemp("data")) as started:
        started.wait_until_ready()
        yield started


def replay(log: RealLog, service: ChildService, site: str) -> dict[str, Any]:
    """`lineloom replay LOG --split 3 --no-odometry`: the figures that it prints."""
    command = [sys.executable, "-m", "lineloom.cli", "replay", str(log.log)]
    command += ["--split", "3", "--no-odometry", "--site", site, "--url", service.url, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures: dict[str, Any] = json.loads(done.stdout)
    return figures


@pytest.mark.parametrize(
    ("site", "log"),
    [("csail", CSAIL), pytest.param("freiburg", FR079, marks=pytest.mark.long)],
)
def test_a_replayed_log_becomes_one_right_map(
    site: str, log: RealLog, service: ChildService
) -> None:
    log.require()
    figures = replay(log, service, site)
    assert (figures["accepted"], figures["rejected"]) == (log.scans, 0)
    streams = load([log.log], split_into=3, odometry=False)
    first_row = accumulate((len(s.scans) for s in streams), initial=0)
    names = sorted(s.robot for s in streams)
    assert [sorted(robots) for robots in figures["components"]] == [names]
    rows, poses = [], []
    with Client(service.url) as client:
        for stream, offset in zip(streams, first_row, strict=False):
            for pose in client.trajectory(site, stream.robot).poses:
                rows.append(offset + pose.seq)
                poses.append((pose.x, pose.y, pose.theta))
        state = client.site(site)
        assert (state.idle, state.scans.pending) == (True, 0)
        found = client.map(site)
        picture = client.map_file(site, "svg")
    log.check(np.array(rows), np.array(poses))
    assert sum(np.hypot(w.x2 - w.x1, w.y2 - w.y1) for w in found.lines if w.support >= 10) > 150.0
    assert len(picture) > 10_000
