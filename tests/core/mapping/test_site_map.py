"""The site's memory: neighbourhoods, drift, and what is left after a robot is forgotten."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import MapperConfig
from lineloom_lab.simulation import SimulatedScan, rectangle

from tests.core.mapping.drives import legs, scans_of
from tests.core.mapping.sites import lay_track, link, thinned


@pytest.fixture(scope="module")
def loop() -> list[SimulatedScan]:
    """Round a room and back to the start: 4 x 3 m, one keyframe every 0.4 m."""
    quarter = (0.0, 0.5 * math.pi)
    drive = legs(Pose(2.0, 1.0, 0.0), *[(4.0, 0.0), quarter, (3.0, 0.0), quarter] * 2, (4.0, 0.0))
    return thinned(scans_of(rectangle(8.0, 5.0), drive))


@pytest.fixture
def site() -> SiteMap:
    return SiteMap(MapperConfig())


def test_the_way_driven_grows_along_a_track(site: SiteMap, loop: list[SimulatedScan]) -> None:
    ids = lay_track(site, loop)
    assert site.driven_between(ids[0], ids[0]) == 0.0
    assert site.driven_between(ids[0], ids[-1]) == pytest.approx(18.0, abs=0.4)
    assert site.driven_between(ids[5], ids[20]) == site.driven_between(ids[20], ids[5])
    a, b, c = ids[2], ids[9], ids[30]
    total = site.driven_between(a, b) + site.driven_between(b, c)
    assert site.driven_between(a, c) == pytest.approx(total)


def test_drift_grows_with_the_way_and_is_none_at_home(
    site: SiteMap, loop: list[SimulatedScan]
) -> None:
    ids = lay_track(site, loop)
    np.testing.assert_array_equal(site.drift(ids[3], ids[3]), np.zeros((3, 3)))
    sizes = [float(np.trace(site.drift(ids[0], k))) for k in ids[1:12]]
    assert sizes == sorted(sizes)


def test_a_closed_loop_cuts_the_way_over_which_error_grew(
    site: SiteMap, loop: list[SimulatedScan]
) -> None:
    ids = lay_track(site, loop)
    start, end = ids[0], ids[-1]
    before = site.way_between(start, end)
    T_start_end = site.pose(start).between(site.pose(end))
    link(site, start, end, T_start_end, kind="loop", state="accepted")
    after = site.way_between(start, end)
    assert before == pytest.approx(site.driven_between(start, end))
    straight = site.pose(start).distance(site.pose(end))
    assert after == pytest.approx(min(before, 3.0 * straight + 5.0))
    assert after < before


def test_nearby_is_the_brute_force_answer(site: SiteMap, loop: list[SimulatedScan]) -> None:
    ids = lay_track(site, loop)
    other = lay_track(site, loop, robot="elsewhere", begin=Pose(0.1, 0.0, 0.0))
    for radius in (0.5, 2.5, 100.0):
        found = site.nearby(ids[7], radius)
        here = site.pose(ids[7])
        expected = sorted(
            (here.distance(site.pose(k)), k)
            for k in ids
            if k != ids[7] and here.distance(site.pose(k)) <= radius
        )
        assert [k for k, _ in found] == [k for _, k in expected]
        assert not {k for k, _ in found} & set(other)  # near in numbers only: no common frame


def test_neighbours_on_the_track_come_nearest_first(
    site: SiteMap, loop: list[SimulatedScan]
) -> None:
    ids = lay_track(site, loop)
    track = site.track(ids[0])
    assert track.neighbours(ids[10], 2) == [ids[10], ids[9], ids[11], ids[8], ids[12]]
    assert track.neighbours(ids[0], 2) == ids[:3]
    assert track.neighbours(ids[-1], 1) == [ids[-1], ids[-2]]


def test_only_accepted_constraints_hold_the_graph_together(
    site: SiteMap, loop: list[SimulatedScan]
) -> None:
    a, b = lay_track(site, loop[:5]), lay_track(site, loop[:5], robot="b")
    made = link(site, a[2], b[2], Pose.identity())
    assert not site.same_component(a[0], b[0])
    site.add_constraint(made.moved_to("accepted", "for the test"))
    assert site.same_component(a[0], b[0])
    assert site.component_id(b[4]) == site.component_id(a[0]) == site.id_of("component", a[0])
    site.add_constraint(made.moved_to("rejected", "for the test"))
    assert not site.same_component(a[0], b[0])
    assert site.component_id(b[4]) == site.id_of("component", b[0])


def test_optimising_pulls_a_bent_track_straight_and_keeps_the_anchor(
    site: SiteMap, loop: list[SimulatedScan]
) -> None:
    true = [loop[0].true_pose.between(s.true_pose) for s in loop]
    bent = [Pose(0, 0, 0.0002 * i) @ pose for i, pose in enumerate(true)]
    ids = lay_track(site, loop, bent)
    link(site, ids[0], ids[-1], true[0].between(true[-1]), kind="loop", state="accepted")
    off_before = site.pose(ids[-1]).distance(true[-1])
    site.optimise(ids[4])
    assert site.pose(ids[0]) == Pose.identity()
    assert site.pose(ids[-1]).distance(true[-1]) < 0.2 * off_before


def test_a_keyframe_that_waits_for_the_graph_is_as_sure_as_the_last_that_does_not_and_its_steps(
    site: SiteMap, loop: list[SimulatedScan]
) -> None:
    a, b = lay_track(site, loop[:12]), lay_track(site, loop[:12], robot="b")
    link(site, a[4], b[4], Pose.identity(), state="accepted")
    with pytest.raises(ValueError, match="not optimised"):
        site.drift(a[2], b[7])
    site.optimise(a[0])
    for k in range(4):
        last, T = site.keyframes[b[-1]], Pose(0.4, 0.02 * k, 0.1)
        step = replace(last.step or pytest.fail("a step"), previous=last.id, T_previous_this=T)
        b.append(b[-1] + 1)
        site.append(replace(last, id=b[-1], step=step, repeat=last.repeat + 1))
    ends = [a[2], a[9], b[3], b[11], *b[12:]]
    waiting = site.drifts(ends).among(ends)
    site.optimise(a[0])
    entered = site.drifts(ends).among(ends)
    assert not np.array_equal(waiting, entered)
    np.testing.assert_allclose(waiting, entered, rtol=1e-5, atol=1e-5 * np.abs(entered).max())
