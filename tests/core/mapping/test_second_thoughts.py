"""Self-correction: a false meeting that was believed is withdrawn and leaves no trace."""

from __future__ import annotations

from dataclasses import replace

from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import DoubtConfig, JoinConfig, MapperConfig
from lineloom_core.mapping.merging.contradictions import contradicted_by
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.evaluation.merge_bench_buildings import building_classes
from lineloom_lab.evaluation.merge_bench_fleets import bench_fleet
from lineloom_lab.evaluation.merge_bench_judge import Judge
from lineloom_lab.simulation import SimulatedRobot, rooms, sick_lms200

from tests.core.mapping.drives import fingerprint
from tests.core.mapping.sites import lay_places, lay_track, link, thinned

HASTY = MapperConfig(
    join=JoinConfig(
        most_false=1.0, least_set=3, most_missing=0.05, most_map_missing=1.0, least_distinctive=0
    ),
    doubt=DoubtConfig(most_missing=0.04, least_compared=4, least_points=1500),
)
"""Believes what any three matches say, as long as nothing speaks loudly against it, and is quick to
think again."""


def test_a_false_meeting_is_withdrawn_when_later_scans_contradict_it() -> None:
    # A hotel whose rooms share their walls: soon joined one door off, rightly half a minute on.
    kind = next(k for k in building_classes(None) if k.name == "hotel floor")
    fleet = bench_fleet(kind, 3, 8, 75.0)
    judge, scans = Judge(fleet), [s for s in fleet.scans() if s.time_s < 26.0]
    mapper, ever_false = SiteMapper(HASTY), False
    withdrawn: list[str] = []
    for s in scans:
        judge.note(s)
        changes = mapper.add(s.robot, s.scan)
        if changes.merges:
            ever_false = ever_false or bool(judge.verdict(mapper.view()).false)
        withdrawn += [c.id for c in changes.withdrawn]
    assert ever_false, "the fleet is no test: nothing false was believed"
    assert withdrawn
    verdict = judge.verdict(mapper.view())
    assert not verdict.false
    assert len(verdict.right) == 1
    rows = {c.id: c for c in mapper.view().constraints}
    for name in withdrawn:
        assert rows[name].state == "retracted"
        assert rows[name].reason.startswith("withdrawn: ")
        assert [h.state for h in rows[name].history][-2:] == ["accepted", "retracted"]
    assert mapper.verdicts.withdrawn.keys() >= set(withdrawn)

    # As if it had never been believed: a mapper that is told beforehand ends with the same map.
    told = SiteMapper(HASTY, verdicts=mapper.verdicts)
    for s in scans:
        told.add(s.robot, s.scan)
    kept = [replace(m.view(), constraints=()) for m in (mapper, told)]
    assert fingerprint(kept[0]) == fingerprint(kept[1])

    # And what an operator restores is not withdrawn again.
    first = next(name for name in withdrawn if name in mapper.verdicts.withdrawn)
    mapper.restore(first)
    assert first not in mapper.verdicts.withdrawn
    assert first in mapper.verdicts.approved


def test_a_slip_of_tracking_is_blamed_on_the_step_and_not_on_the_meeting() -> None:
    robot = SimulatedRobot.wandering("a", rooms(2), lidar=sick_lms200(), seed=3, duration_s=60.0)
    first, second = (thinned(list(r.scans())) for r in (robot, replace(robot, name="b", seed=77)))
    site = SiteMap(MapperConfig())
    a = lay_track(site, first, robot="a")
    true = [second[0].true_pose.between(s.true_pose) for s in second]
    half = len(true) // 2
    slipped = true[:half] + [Pose(2.5, 0.0, 0.0) @ pose for pose in true[half:]]
    b = lay_track(site, second, slipped, robot="b")
    T_a_b = first[4].true_pose.between(second[4].true_pose)
    link(site, a[4], b[4], T_a_b, state="accepted")
    site.optimise(a[0])
    lay_places(site, a)
    named = None
    for begin in range(0, len(b) - 8 + 1, 4):
        place = site.add_place(tuple(b[begin : begin + 8]))
        found = contradicted_by(site, place)
        if begin + 8 <= half:
            assert found == (), "nothing is wrong yet"
        elif found:
            named = found
            break
    assert named is not None
    assert [c.kind for c in named] == ["sequential"]
    assert b[half - 8] <= named[0].keyframe_a <= b[half + 12]
    assert named[0].reason.startswith("withdrawn: tracking slipped")
