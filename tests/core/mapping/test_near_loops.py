"""Loops where the graph predicts them: right when right, refused when not."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.merging.near_loops import close_near_loop
from lineloom_lab.simulation import SimulatedScan, rooms

from tests.core.mapping.drives import covered, legs, scans_of
from tests.core.mapping.sites import lay_track, link, thinned


@pytest.fixture(scope="module")
def there_and_back() -> list[SimulatedScan]:
    """Up and down a room twice, so that the end looks at what the beginning saw."""
    turn = (0.0, math.pi)
    drive = legs(Pose(1.0, 3.4, 0.0), *[(3.0, 0.0), turn] * 5)
    return thinned(scans_of(rooms(0), drive))


def lay_with_error(site: SiteMap, scans: list[SimulatedScan], error: Pose) -> list[int]:
    """The second half of the track is off by `error`, seen from the track's beginning."""
    true = [scans[0].true_pose.between(s.true_pose) for s in scans]
    half = len(true) // 2
    return lay_track(site, scans, true[:half] + [error @ pose for pose in true[half:]])


def close_all(site: SiteMap, ids: list[int]) -> list[Constraint]:
    return [found for k in ids if (found := close_near_loop(site, k)) is not None]


@pytest.mark.parametrize("error", [Pose(0, 0, 0), Pose(0.25, -0.2, 0.0), Pose(0.0, 0.1, 0.03)])
def test_near_loops_measure_the_true_pose_whatever_the_graph_believed(
    there_and_back: list[SimulatedScan], error: Pose
) -> None:
    site = SiteMap(MapperConfig())
    ids = lay_with_error(site, there_and_back, error)
    found = close_all(site, ids)
    assert len(found) >= 4
    number = {k: i for i, k in enumerate(ids)}
    crossing = [c for c in found if number[c.keyframe_a] < len(ids) // 2 <= number[c.keyframe_b]]
    assert crossing
    for c in found:
        a, b = (there_and_back[number[k]].true_pose for k in (c.keyframe_a, c.keyframe_b))
        off = a.between(b).between(c.T_a_b)
        assert math.hypot(off.x, off.y) < 0.05
        assert abs(off.theta) < 0.02
        assert c.kind == "loop"
        assert site.constraints[c.id].state == "accepted"
        assert c.id in site.graph.edges


def test_partners_are_far_apart_in_time_and_near_in_space(
    there_and_back: list[SimulatedScan],
) -> None:
    config = MapperConfig().near_loops
    site = SiteMap(MapperConfig())
    ids = lay_track(site, there_and_back)
    for c in close_all(site, ids):
        assert c.keyframe_a < c.keyframe_b
        assert site.driven_between(c.keyframe_a, c.keyframe_b) > config.apart
        assert site.pose(c.keyframe_a).distance(site.pose(c.keyframe_b)) <= config.radius


def test_there_is_no_partner_across_components(there_and_back: list[SimulatedScan]) -> None:
    site = SiteMap(MapperConfig())
    short = there_and_back[:10]  # too short to close a loop with itself
    first, second = lay_track(site, short, robot="a"), lay_track(site, short, robot="b")
    assert close_all(site, first + second) == []
    # The same two tracks in one component do find each other: the refusal was the component's.
    link(site, first[0], second[0], Pose.identity(), state="accepted")
    assert len(close_all(site, second)) > 0


def test_an_error_beyond_the_window_is_not_closed(there_and_back: list[SimulatedScan]) -> None:
    site = SiteMap(MapperConfig())
    ids = lay_with_error(site, there_and_back, Pose(1.2, 0.0, 0.0))
    half = ids[len(ids) // 2]
    for c in close_all(site, ids):
        assert not c.keyframe_a < half <= c.keyframe_b


def test_what_does_not_fit_is_refused(there_and_back: list[SimulatedScan]) -> None:
    site = SiteMap(MapperConfig())
    half = len(there_and_back) // 2
    spoilt = there_and_back[:half] + [
        replace(s, scan=covered(s.scan)) for s in there_and_back[half:]
    ]
    assert close_all(site, lay_track(site, spoilt)) == []
    assert all(c.kind == "sequential" for c in site.constraints.values())
