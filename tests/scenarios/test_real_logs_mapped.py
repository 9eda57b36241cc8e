"""Real buildings without odometry, through the mapper alone: as one robot, and cut into three."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Scan

from tests.scenarios import tinyslam
from tests.scenarios.real_logs import CSAIL, FR079, RealLog

pytestmark = pytest.mark.scenario


def play_all(streams: Mapping[str, Sequence[Scan]]) -> SiteView:
    """Let robots set out together that know nothing of each other."""
    mapper = SiteMapper()
    for step in range(max(len(scans) for scans in streams.values())):
        for robot, scans in streams.items():
            if step < len(scans):
                mapper.add(robot, scans[step])
    return mapper.view()


def cut(log: RealLog, robots: int, *, odometry: bool = False) -> dict[str, list[Scan]]:
    """Cut a log by time into robots."""
    parts = np.array_split(np.array(log.read(odometry=odometry), dtype=object), robots)
    return {f"r{number}": list(part) for number, part in enumerate(parts)}


def play(log: RealLog, robots: int, *, odometry: bool = False) -> SiteView:
    """What the robots that a log is cut into come to."""
    return play_all(cut(log, robots, odometry=odometry))


def robots_by_component(view: SiteView) -> list[set[str]]:
    """Robots that have poses in each component."""
    return [
        {name for name, t in view.trajectories.items() if component.id in t.component}
        for component in view.components
    ]


@pytest.mark.parametrize(
    ("log", "robots"),
    [
        (CSAIL, 1),  # three robots: by way of a service, see test_real_logs_over_http
        *(pytest.param(CSAIL, k, marks=pytest.mark.long) for k in (2, 3, 4)),
        *(pytest.param(FR079, k, marks=pytest.mark.long) for k in (1, 2, 3, 4)),
    ],
    ids=lambda value: value.name if isinstance(value, RealLog) else str(value),
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


@pytest.mark.long
def test_runs_in_two_rooms_become_one_map() -> None:
    """`test_lab`, whose room was furnished otherwise, may still wait for more evidence."""
    tinyslam.require()
    view = play_all({run: tinyslam.read(run) for run in tinyslam.RUNS})
    together = max(robots_by_component(view), key=len)
    assert together >= set(tinyslam.RUNS) - {"test_lab"}
    shared = sum(np.hypot(w.x2 - w.x1, w.y2 - w.y1) for w in view.lines if len(w.robots) >= 4)
    assert shared > 15.0  # metres of wall that four robots and more agree on


@pytest.mark.long
def test_robots_in_different_buildings_are_never_joined() -> None:
    CSAIL.require()
    FR079.require()
    tinyslam.require()
    buildings = {
        "csail": {f"csail-{r}": s for r, s in cut(CSAIL, 2).items()},
        "fr079": {f"fr079-{r}": s for r, s in cut(FR079, 4).items()},
        "mines": {run: tinyslam.read(run) for run in tinyslam.RUNS},
    }
    view = play_all({name: s for robots in buildings.values() for name, s in robots.items()})
    for robots in robots_by_component(view):
        assert any(robots <= set(inside) for inside in buildings.values()), robots


def test_odometry_that_is_metres_off_does_no_harm() -> None:
    """CSAIL's own wheels are 8.8 m off in the end: the map must not follow them."""
    CSAIL.require()
    view = play(CSAIL, 1, odometry=True)
    assert len(view.components) == 1
    trajectory = view.trajectories["r0"]
    CSAIL.check(trajectory.seq, trajectory.poses)
