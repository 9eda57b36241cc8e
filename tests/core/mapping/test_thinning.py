"""Letting go: the map grows with its building, and nothing that is known gets lost by it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.belief.resting import Resting
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.belief.thinning import thin
from lineloom_core.mapping.belief.track import Track
from lineloom_core.mapping.config import MapperConfig, ThinningConfig
from lineloom_core.mapping.facts.keyframe import Step
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.mapping.snapshot import Snapshot
from lineloom_lab.simulation import SimulatedScan, World, sick_lms200

from tests.core.mapping.drives import component_error, feed, fingerprint, legs, scans_of
from tests.core.mapping.sites import lay_places, lay_track, link, thinned

TIGHT = MapperConfig(thinning=ThinningConfig(most_alike=2, apart=12.0), chapter=32)
NEVER = MapperConfig(thinning=ThinningConfig(most_alike=1_000_000))


ROUND = [(9.0, 0.0), (0.0, np.pi / 2), (6.0, 0.0), (0.0, np.pi / 2)] * 2


def hall() -> World:
    """12 by 9 m with an alcove and three boxes, no corner like another."""
    walls = outline((0, 0), (12, 0), (12, 3), (12.8, 3), (12.8, 5), (12, 5), (12, 9), (0, 9))
    for x, y, width, depth in ((3.5, 3.2, 2.0, 1.4), (7.5, 4.0, 0.9, 2.0), (0.0, 4.0, 0.6, 1.2)):
        corners = ((x, y), (x, y + depth), (x + width, y + depth), (x + width, y))
        walls += outline(*corners)
    return World(np.array(walls))


def outline(*corners: tuple[float, float]) -> list[tuple[float, float, float, float]]:
    return [(*a, *b) for a, b in itertools.pairwise((*corners, corners[0]))]


def some_step(seed: int, previous: int = 0) -> Step:
    rng = np.random.default_rng(seed)
    root, drift = rng.normal(size=(2, 3, 3))
    information = 1e3 * (root @ root.T + np.eye(3))
    pose = Pose.from_array(rng.normal(size=3))
    checks = {"fit": float(rng.uniform()), "conflict_share": float(rng.uniform())}
    return Step(previous, pose, information, 1e-4 * (drift @ drift.T + np.eye(3)), checks)


def test_composed_steps_do_not_depend_on_how_they_are_bracketed() -> None:
    a, b, c = (some_step(seed) for seed in range(3))
    left, right = a.then(b).then(c), a.then(b.then(c))
    assert left.T_previous_this.distance(right.T_previous_this) < 1e-12
    np.testing.assert_allclose(left.information, right.information, rtol=1e-9)
    np.testing.assert_allclose(left.drift, right.drift, rtol=1e-9)
    assert left.checks == right.checks
    assert left.checks["fit"] == min(s.checks["fit"] for s in (a, b, c))


def test_a_composed_step_has_the_drift_of_its_way() -> None:
    steps = [some_step(seed) for seed in range(5)]
    track = Track("0", "r")
    track.append(0, Pose.identity(), np.zeros((3, 3)))
    for k, step in enumerate(steps, start=1):
        track.append(k, step.T_previous_this, step.drift)
    whole = steps[0]
    for step in steps[1:]:
        whole = whole.then(step)
    np.testing.assert_allclose(whole.drift, track.drift(0, 5), rtol=1e-9, atol=1e-15)


def test_what_rests_moves_on_with_what_it_rests_on() -> None:
    resting = Resting()
    a, b = Pose(1.0, 0.0, 0.5), Pose(0.0, 2.0, -0.2)
    resting.lay(7, 5, a)
    resting.lay(5, 3, b)
    assert resting.on(5) == (3, b)
    holder, pose = resting.on(7)
    assert holder == 3
    assert pose.distance(b @ a) < 1e-12
    assert resting.on(3) == (3, Pose.identity())
    assert 7 in resting
    assert 3 not in resting


def test_resting_agrees_with_its_slow_twin() -> None:
    rng = np.random.default_rng(3)
    resting, twin = Resting(), dict[int, tuple[int, Pose]]()
    staying = list(range(300))
    for keyframe in rng.permutation(300).tolist()[:290]:
        staying.remove(keyframe)
        holder, T = int(rng.choice(staying)), Pose.from_array(rng.normal(size=3))
        resting.lay(keyframe, holder, T)
        for other, (on, T_on) in twin.items():
            if on == keyframe:
                twin[other] = holder, T @ T_on
        twin[keyframe] = holder, T
    assert len(resting) == 290
    assert {k: resting.on(k) for k in range(300) if k in resting} == twin
    assert all(resting.on(k) == (k, Pose.identity()) for k in (*staying, 10_000))


@pytest.fixture(scope="module")
def rounds() -> list[SimulatedScan]:
    """One robot, five times round the hall."""
    return thinned(scans_of(hall(), legs(Pose(1.5, 1.5, 0.0), *ROUND * 5)))


def laid(scans: Sequence[SimulatedScan], config: MapperConfig) -> tuple[SiteMap, list[int]]:
    site = SiteMap(config)
    ids = lay_track(site, scans)
    return site, ids


def test_thinning_moves_nothing_and_parts_nothing(rounds: list[SimulatedScan]) -> None:
    site, ids = laid(rounds, TIGHT)
    before = {k: site.pose(k) for k in ids}
    gone = [
        p for place in lay_places(site, ids) if place.id in site.places for p in thin(site, place)
    ]
    assert len(gone) > 10
    assert len(site.keyframes) < 0.7 * len(ids)
    assert {site.component_id(k) for k in ids} == {site.id_of("component", ids[0])}
    for k in ids:
        assert site.pose(k).distance(before[k]) < 1e-9
    for a, b in itertools.pairwise(site.track(ids[0]).kept):
        step = site.step(b)
        assert step is not None
        assert (step.keyframe_a, step.keyframe_b) == (a, b)
        assert step.T_a_b.distance(before[a].between(before[b])) < 1e-9
    assert all(k in site.keyframes for place in site.places.values() for k in place.keyframes)


def test_the_oldest_and_the_latest_stay_and_so_does_the_name(rounds: list[SimulatedScan]) -> None:
    site, ids = laid(rounds, TIGHT)
    places = lay_places(site, ids)
    gone = {p.id for place in places if place.id in site.places for p in thin(site, place)}
    assert places[0].id not in gone
    driven = site.track(ids[0]).travelled
    recent = {p.id for p in places if driven[-1] - driven[site.track(p.id).position(p.id)] < 12.0}
    assert not recent & gone
    assert ids[0] in site.keyframes


def test_a_meeting_is_never_let_go(rounds: list[SimulatedScan]) -> None:
    site, ids = laid(rounds, TIGHT)
    other = lay_track(site, rounds[:20], robot="s")
    met = [ids[30], ids[31]]
    for k in met:
        T = site.pose(k).between(site.pose(other[5]))
        link(site, k, other[5], T, state="accepted")
    for place in lay_places(site, ids):
        if place.id in site.places:
            thin(site, place)
    assert len(site.keyframes) < 0.7 * len(ids) + len(other)
    assert all(k in site.keyframes for k in met)
    assert site.same_component(ids[-1], other[-1])


@pytest.fixture(scope="module")
def long_drive() -> list[SimulatedScan]:
    """Two robots, eight times round one hall, the second one half a round behind.

    Their lidars turn slowly: what is let go, and what it leaves, depends on keyframes alone.
    """
    slow = replace(sick_lms200(), rate_hz=2.5)
    drives = [
        legs(Pose(1.5, 1.5, 0.0), *ROUND * 8, speed=1.0, rate=1.0),
        legs(Pose(10.5, 7.5, np.pi), *ROUND * 8, speed=1.0, rate=1.0),
    ]
    seen = [
        scan
        for n, drive in enumerate(drives)
        for scan in scans_of(hall(), drive, name=f"robot-{n}", seed=n, lidar=slow)
    ]
    return sorted(seen, key=lambda s: (s.scan.stamp, s.robot))


@dataclass(frozen=True)
class Kept:
    """The mapper at the end; its keyframes after each round, shown and made; two states before."""

    mapper: SiteMapper
    shown: list[int]
    made: list[int]
    early: Snapshot
    half: Snapshot


@pytest.fixture(scope="module")
def kept(long_drive: list[SimulatedScan]) -> Kept:
    mapper, shown, made, states = SiteMapper(TIGHT), list[int](), [0], list[Snapshot]()
    for number, part in enumerate(np.array_split(np.arange(len(long_drive)), 8), start=1):
        changes = feed(mapper, (long_drive[i] for i in part))
        shown.append(len(mapper.view().keyframes))
        made.append(made[-1] + sum(c.keyframe is not None for c in changes))
        if number in {2, 4}:
            states.append(mapper.snapshot())
    return Kept(mapper, shown, made[1:], *states)


def test_a_map_stops_growing_where_all_is_known(kept: Kept) -> None:
    assert kept.made[7] > 3 * kept.made[1]
    assert kept.shown[7] < 1.15 * kept.shown[1], kept.shown


def test_what_was_let_go_keeps_its_place_in_the_trajectory(
    kept: Kept, long_drive: list[SimulatedScan]
) -> None:
    view = kept.mapper.view()
    assert len(view.components) == 1
    assert sum(len(t.seq) for t in view.trajectories.values()) == len(long_drive)
    assert component_error(view, long_drive, view.components[0].id).rmse < 0.03


def test_the_map_is_as_good_as_one_of_everything(
    kept: Kept, long_drive: list[SimulatedScan]
) -> None:
    full = SiteMapper(NEVER)
    feed(full, long_drive)
    views = kept.mapper.view(), full.view()
    component = views[1].components[0].id
    thin_error, full_error = (component_error(v, long_drive, component) for v in views)
    assert thin_error.rmse < full_error.rmse + 0.005
    thin_share, full_share = (share_mapped(v, long_drive[0].true_pose) for v in views)
    assert full_share > 0.85
    assert thin_share > full_share - 0.03, thin_share


def share_mapped(view: SiteView, T_world_map: Pose) -> float:
    """Share of the hall's walls that some line of the map lies on."""
    points = np.concatenate([np.linspace(w[:2], w[2:], 40) for w in hall().walls])
    points = T_world_map.inverse().transform(points)
    lines = np.array([(line.x1, line.y1, line.x2, line.y2) for line in view.lines])
    start, along = lines[:, None, :2], (lines[:, 2:] - lines[:, :2])[:, None]
    share = np.sum((points - start) * along, axis=2) / np.sum(along**2, axis=2)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * along
    distance = np.linalg.norm(points - nearest, axis=2).min(axis=0)
    return float(np.mean(distance < 0.08))


def test_a_snapshot_of_a_thinned_map_goes_on_bit_by_bit(
    kept: Kept, long_drive: list[SimulatedScan]
) -> None:
    resumed = SiteMapper.resume(kept.half)
    feed(resumed, long_drive[resumed.version :])
    assert fingerprint(resumed.view()) == fingerprint(kept.mapper.view())


def test_undo_in_a_thinned_map_is_as_if_it_had_never_been_believed(
    kept: Kept, long_drive: list[SimulatedScan]
) -> None:
    mapper = SiteMapper.resume(kept.early)
    so_far = mapper.version
    assert kept.shown[1] < 0.9 * kept.made[1], "nothing was let go of"
    name = next(
        c.id for c in mapper.view().constraints if c.kind == "rendezvous" and c.state == "accepted"
    )
    mapper.retract(name)
    view = mapper.view()
    shown = {k.id for k in view.keyframes}
    assert all({c.keyframe_a, c.keyframe_b} <= shown for c in view.constraints)
    never = SiteMapper(TIGHT, verdicts=mapper.verdicts)
    feed(never, long_drive[:so_far])
    views = [replace(m.view(), version=0) for m in (mapper, never)]
    assert fingerprint(views[0]) == fingerprint(views[1])
    assert mapper.explain(name) is not None
