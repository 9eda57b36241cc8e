"""People in the map: what they leave behind fades, the walls stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.fusion.persistence import PersistenceConfig
from lineloom_core.mapping.answers.site_view import MapLine, SiteView
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import Fleet, SimulatedScan, rooms, scanner_360
from numpy.typing import NDArray

from tests.core.mapping.drives import feed, fingerprint

WORLD = rooms(2)
NOTHING_FADES = PersistenceConfig(loss=0.0)


@pytest.fixture(scope="module")
def crowded() -> list[SimulatedScan]:
    """A robot in four rooms where five people walk about."""
    fleet = Fleet.touring(WORLD, robots=1, seed=3, duration_s=60.0, lidar=scanner_360(), people=5)
    return list(fleet.scans())


def mapped(scans: list[SimulatedScan], persistence: PersistenceConfig) -> SiteView:
    mapper = SiteMapper(replace(MapperConfig(), persistence=persistence))
    feed(mapper, scans)
    return mapper.view()


def on_a_wall(line: MapLine, scans: list[SimulatedScan]) -> bool:
    """Whether the line's middle lies within 0.15 m of anything solid of the world."""
    T_world_map = scans[0].true_pose
    middle = T_world_map.transform([[0.5 * (line.x1 + line.x2), 0.5 * (line.y1 + line.y2)]])[0]
    return WORLD.clearance(float(middle[0]), float(middle[1])) < 0.15


def metres(lines: list[MapLine]) -> float:
    return sum(float(np.hypot(w.x2 - w.x1, w.y2 - w.y1)) for w in lines)


def test_people_fade_and_walls_stay(crowded: list[SimulatedScan]) -> None:
    with_all = mapped(crowded, NOTHING_FADES).lines
    left = mapped(crowded, PersistenceConfig()).lines
    strangers = [w for w in with_all if not on_a_wall(w, crowded)]
    strangers_left = [w for w in left if not on_a_wall(w, crowded)]
    assert metres(strangers) > 3.0
    assert metres(strangers_left) < 0.5 * metres(strangers)
    walls = metres([w for w in with_all if on_a_wall(w, crowded)])
    assert metres([w for w in left if on_a_wall(w, crowded)]) > 0.97 * walls


def test_what_is_left_is_what_was_fused_or_a_part_of_it(crowded: list[SimulatedScan]) -> None:
    whole = mapped(crowded, NOTHING_FADES).lines
    left = mapped(crowded, PersistenceConfig()).lines
    assert len({w.id for w in left}) == len(left)
    for w in left:
        sources = [v for v in whole if v.wall == w.wall]
        assert w.support <= max(v.support for v in sources)
        assert min(v.first_seen for v in sources) <= w.first_seen <= w.last_seen
        assert w.last_seen <= max(v.last_seen for v in sources)
        middle = 0.5 * np.array([w.x1 + w.x2, w.y1 + w.y2])
        assert min(off_line(v, middle) for v in sources) < 1e-9


def off_line(line: MapLine, point: NDArray[np.float64]) -> float:
    """How far a point is from the endless line [m]."""
    u = np.array([line.x2 - line.x1, line.y2 - line.y1])
    away = point - [line.x1, line.y1]
    return float(abs(u[0] * away[1] - u[1] * away[0]) / np.hypot(*u))


def test_fading_survives_a_restart(crowded: list[SimulatedScan]) -> None:
    half = len(crowded) // 2
    straight = SiteMapper()
    feed(straight, crowded[:half])
    resumed = SiteMapper.resume(straight.snapshot())
    for mapper in (straight, resumed):
        feed(mapper, crowded[half:])
    assert fingerprint(straight.view()) == fingerprint(resumed.view())
