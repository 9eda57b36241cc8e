"""A closed path from a scan every half metre to every two: one map, every scan in its place."""

from __future__ import annotations

import math

import pytest
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.experiments.recording import closed_path


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("scans", [23, 45, 90])
def test_every_scan_of_a_sparse_path_is_in_its_place(scans: int, seed: int) -> None:
    recording = closed_path(seed, scans)
    mapper = SiteMapper()
    for scan in recording.scans:
        mapper.add("robot", scan)
    view = mapper.view()
    assert len(view.components) == 1
    trajectory = view.trajectories["robot"]
    assert trajectory.seq.tolist() == list(range(scans))
    origin = recording.poses[0]
    true = [origin.between(recording.poses[i]) for i in trajectory.seq.tolist()]
    errors = [math.dist((t.x, t.y), p[:2]) for t, p in zip(true, trajectory.poses, strict=True)]
    assert max(errors) <= 0.05
