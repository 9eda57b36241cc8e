"""Real buildings without odometry, through the mapper alone: as one robot, and cut into three."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.mapping.site_view import SiteView

from tests.scenarios.real_logs import CSAIL, FR079, RealLog

pytestmark = pytest.mark.scenario


def play(log: RealLog, robots: int, *, odometry: bool = False) -> SiteView:
    """Cut a log by time into robots that set out together and know nothing of each other."""
    parts = np.array_split(np.array(log.read(odometry=odometry), dtype=object), robots)
    mapper = SiteMapper()
    for step in range(max(len(part) for part in parts)):
        for number, part in enumerate(parts):
            if step < len(part):
                mapper.add(f"r{number}", part[step])
    return mapper.view()


@pytest.mark.parametrize("robots", [1, 3])
@pytest.mark.parametrize(
    "log", [CSAIL, pytest.param(FR079, marks=pytest.mark.long)], ids=lambda log: log.name
)
def test_a_real_building_becomes_one_right_map(log: RealLog, robots: int) -> None:
    log.require()
    view = play(log, robots)
    assert len(view.robots) == robots
    assert len(view.components) == 1
    assert len(view.merged_into) == robots - 1
    log.check(
        np.concatenate([t.seq for t in view.trajectories.values()]),
        np.concatenate([t.poses for t in view.trajectories.values()]),
    )
    walls = [np.hypot(w.x2 - w.x1, w.y2 - w.y1) for w in view.lines if w.support >= 10]
    assert sum(walls) > 150.0  # metres that ten scans and more agree on


def test_odometry_that_is_metres_off_does_no_harm() -> None:
    """CSAIL's own wheels are 8.8 m off in the end: the map must not follow them."""
    CSAIL.require()
    view = play(CSAIL, 1, odometry=True)
    assert len(view.components) == 1
    trajectory = view.trajectories["r0"]
    CSAIL.check(trajectory.seq, trajectory.poses)
