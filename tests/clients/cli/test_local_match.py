"""`lineloom match` without a service: the pose asked for is the one the simulator put there."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from lineloom.cli.app import app
from lineloom_core.geometry import Pose
from lineloom_core.io.jsonl import ScanRecord, write_jsonl
from lineloom_lab.simulation import rooms, scanner_360
from typer.testing import CliRunner

from tests.clients.fake_service import scan


@pytest.fixture
def pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Pose]:
    """Two scans of one room, 0.7 m and half a turn apart, and T_first_second."""
    monkeypatch.delenv("LINELOOM_URL", raising=False)
    world, lidar, rng = rooms(1), scanner_360(), np.random.default_rng(4)
    poses = [Pose(2.5, 2.0, 0.3), Pose(3.0, 2.5, 0.3 + math.pi)]
    scans = [lidar.scan(world, pose, rng, stamp=float(n)) for n, pose in enumerate(poses)]
    path = tmp_path / "pair.jsonl"
    write_jsonl(path, [ScanRecord(scan) for scan in scans])
    return path, poses[0].between(poses[1])


def test_the_pose_found_is_the_true_one(pair: tuple[Path, Pose]) -> None:
    path, true = pair
    result = CliRunner().invoke(app, ["match", f"{path}:1", f"{path}:2", "--json"])
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["verdict"] == "match"
    found = Pose(**answer["T_reference_current"])
    apart = true.between(found)
    assert math.hypot(apart.x, apart.y) < 0.03
    assert abs(apart.theta) < math.radians(0.5)
    assert np.array(answer["covariance"]).shape == (3, 3)
    assert answer["pairs"]


def test_nothing_to_see_is_no_match_and_exit_code_4(
    tmp_path: Path, pair: tuple[Path, Pose]
) -> None:
    empty = tmp_path / "empty.json"
    empty.write_text(json.dumps(scan(0) | {"ranges": [None] * 60}), encoding="utf-8")
    result = CliRunner().invoke(app, ["match", str(pair[0]), str(empty)])
    assert result.exit_code == 4, result.output
    assert result.stdout.startswith("none (score 0.0")


def test_a_scan_that_means_nothing_is_told(tmp_path: Path, pair: tuple[Path, Pose]) -> None:
    wrong = tmp_path / "wrong.json"
    wrong.write_text(json.dumps(scan(0) | {"angle_increment": 0.0}), encoding="utf-8")
    result = CliRunner().invoke(app, ["match", str(pair[0]), str(wrong)])
    assert result.exit_code == 1
    assert result.stderr == "lineloom: scan B: angle_increment: must not be 0\n"
