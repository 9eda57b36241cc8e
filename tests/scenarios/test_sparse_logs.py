"""Real buildings scanned about once a metre, without odometry, whatever the clock says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Scan
from lineloom_lab.evaluation import trajectory_error
from lineloom_lab.evaluation.log_bench_files import LogFile
from lineloom_lab.evaluation.log_bench_log import Recording
from numpy.typing import NDArray

from tests.scenarios.real_logs import DATA

pytestmark = pytest.mark.scenario

MOST_RMSE = 0.06
"""Metres, after the best rigid motion."""


def sparse_log(name: str) -> Recording:
    path = DATA / "sparse" / f"{name}.npz"
    if not path.is_file():
        pytest.skip(f"no real data: {path} is missing")
    (recording,) = LogFile(name, path).load().recordings
    return recording


def mapped(scans: Sequence[Scan]) -> SiteView:
    mapper = SiteMapper()
    for scan in scans:
        mapper.add("robot", scan)
    return mapper.view()


def poses_of(view: SiteView, scans: int) -> NDArray[np.float64]:
    """Pose of every scan, NaN where it has none; of one component."""
    assert len(view.components) == 1
    trajectory = view.trajectories["robot"]
    poses = np.full((scans, 3), np.nan)
    poses[trajectory.seq] = trajectory.poses
    return poses


@cache
def with_its_clock(name: str) -> NDArray[np.float64]:
    log = sparse_log(name)
    return poses_of(mapped(log.scans), len(log.scans))


@pytest.mark.parametrize("name", ["seattle", "freiburg-101"])
def test_a_scan_about_every_metre_is_enough(name: str) -> None:
    log = sparse_log(name)
    poses = with_its_clock(name)
    assert np.isfinite(poses).all()
    error = trajectory_error(poses, log.reference)
    assert error.rmse <= MOST_RMSE, error


@pytest.mark.parametrize(
    ("name", "jumping"), [("seattle", False), ("freiburg-101", False), ("seattle", True)]
)
def test_the_clock_decides_nothing(name: str, jumping: bool) -> None:
    """Whether it stands still or jumps about, forth and back; the logs' own is regular."""
    log = sparse_log(name)
    stamps = np.random.default_rng(0).uniform(0.0, 100.0 if jumping else 0.0, len(log.scans))
    scans = [replace(s, stamp=t) for s, t in zip(log.scans, stamps.tolist(), strict=True)]
    apart = np.hypot(*(with_its_clock(name) - poses_of(mapped(scans), len(scans)))[:, :2].T)
    assert np.mean(apart <= 0.05) >= 0.95
