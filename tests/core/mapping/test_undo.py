"""Undo: what is retracted leaves no trace, and what is restored is as it was."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest
from lineloom_core.mapping.answers.site_view import ConstraintView, SiteView
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.mapping.snapshot import Snapshot
from lineloom_lab.simulation import Fleet, SimulatedScan, rooms, sick_lms200

from tests.core.mapping.drives import component_error, feed, fingerprint, mapped


@pytest.fixture(scope="module")
def log() -> list[SimulatedScan]:
    """Two robots in four rooms; they meet after half a minute."""
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=50.0, lidar=sick_lms200())
    return list(fleet.scans())


@pytest.fixture(scope="module")
def snapshot(log: list[SimulatedScan]) -> Snapshot:
    return mapped(log).snapshot()


@pytest.fixture
def mapper(snapshot: Snapshot) -> SiteMapper:
    return SiteMapper.resume(snapshot)


def accepted(view: SiteView, kind: str) -> list[ConstraintView]:
    return [c for c in view.constraints if c.kind == kind and c.state == "accepted"]


def recognised(view: SiteView) -> ConstraintView:
    return accepted(view, "rendezvous")[0]


def apart_from(view: SiteView, *names: str) -> tuple[object, ...]:
    """The map without the retracted constraints' own rows, which stay to be looked at."""
    rest = tuple(c for c in view.constraints if c.id not in names)
    return fingerprint(replace(view, constraints=rest, version=0))


def state(view: SiteView, name: str) -> str:
    return next(c.state for c in view.constraints if c.id == name)


def never_believed(log: Iterable[SimulatedScan], known: SiteMapper) -> SiteMapper:
    """A mapper that was told before the first scan never to believe the constraint."""
    other = SiteMapper(verdicts=known.verdicts)
    feed(other, log)
    return other


def test_retracting_a_meeting_parts_the_robots(mapper: SiteMapper) -> None:
    assert len(mapper.view().components) == 1
    name = recognised(mapper.view()).id
    mapper.retract(name)
    view = mapper.view()
    assert {c.robots for c in view.components} == {("robot-1",), ("robot-2",)}
    assert view.merged_into == {}
    assert not accepted(view, "rendezvous")
    gone = next(c for c in view.constraints if c.id == name)
    assert (gone.state, gone.residual) == ("retracted", None)
    assert [h.state for h in gone.history] == ["candidate", "accepted", "retracted"]
    assert gone.history[-1].version == view.version


def test_what_says_the_same_is_refused_with_it(mapper: SiteMapper) -> None:
    name = recognised(mapper.view()).id
    mapper.retract(name)
    reasons = {c.reason for c in mapper.view().constraints if c.state == "rejected"}
    assert f"says the same as {name}, which was retracted" in reasons


@pytest.mark.parametrize("kind", ["rendezvous", "loop", "sequential"])
def test_retracting_is_as_if_it_had_never_been_believed(
    mapper: SiteMapper, log: list[SimulatedScan], kind: str
) -> None:
    chosen = accepted(mapper.view(), kind)
    name = chosen[len(chosen) // 2].id
    mapper.retract(name)
    assert apart_from(mapper.view(), name) == apart_from(never_believed(log, mapper).view(), name)


def test_a_retracted_pair_is_never_proposed_again(log: list[SimulatedScan]) -> None:
    half = int(0.8 * len(log))
    mapper = mapped(log[:half])
    found = [c for c in mapper.view().constraints if c.kind == "rendezvous"]
    assert found
    mapper.retract(found[0].id)
    feed(mapper, log[half:])
    assert state(mapper.view(), found[0].id) == "retracted"
    assert len(mapper.view().components) == 2


def test_restoring_gives_the_map_back_bit_for_bit(mapper: SiteMapper) -> None:
    before = mapper.view()
    name = recognised(before).id
    mapper.retract(name)
    mapper.restore(name)
    assert fingerprint(replace(mapper.view(), version=0)) == fingerprint(replace(before, version=0))


def test_order_of_retractions_does_not_matter(snapshot: Snapshot) -> None:
    mappers = [SiteMapper.resume(snapshot) for _ in range(2)]
    view = mappers[0].view()
    names = [accepted(view, "loop")[0].id, recognised(view).id]
    for mapper, order in zip(mappers, (names, names[::-1]), strict=True):
        for name in order:
            mapper.retract(name)
    assert apart_from(mappers[0].view(), *names) == apart_from(mappers[1].view(), *names)


def test_verdicts_survive_a_snapshot(mapper: SiteMapper) -> None:
    mapper.retract(recognised(mapper.view()).id)
    resumed = SiteMapper.resume(mapper.snapshot())
    assert fingerprint(resumed.view()) == fingerprint(mapper.view())


def test_a_retracted_step_cuts_the_track(mapper: SiteMapper, log: list[SimulatedScan]) -> None:
    step = accepted(mapper.view(), "sequential")[10]
    mapper.retract(step.id)
    view = mapper.view()
    assert state(view, step.id) == "retracted"
    # The parts are joined again only where something else vouches for it, and then rightly.
    for component in view.components:
        assert component_error(view, log, component.id).max < 0.2


def test_unknown_and_repeated_actions_only_count(mapper: SiteMapper) -> None:
    name = recognised(mapper.view()).id
    mapper.retract(name)
    before = mapper.view()
    for act, what in ((mapper.retract, name), (mapper.retract, "p1-2"), (mapper.restore, "s3")):
        act(what)
    after = mapper.view()
    assert after.version == before.version + 3
    assert fingerprint(replace(after, version=0)) == fingerprint(replace(before, version=0))


def test_what_if_says_what_retracting_then_does_and_changes_nothing(mapper: SiteMapper) -> None:
    before = mapper.view()
    name = recognised(before).id
    answer = mapper.what_if(name)
    assert answer is not None
    assert fingerprint(mapper.view()) == fingerprint(before)
    assert (answer.action, answer.constraint) == ("retract", name)
    mapper.retract(name)
    after = mapper.view()
    assert answer.components_after == {c.id: c.robots for c in after.components}
    for move in answer.robots:
        assert move.component_before == before.robots[move.robot].component
        assert move.component_after == after.robots[move.robot].component
        then, now = before.robots[move.robot].pose, after.robots[move.robot].pose
        assert then is not None
        assert now is not None
        if move.component_before == move.component_after:
            assert move.moved == pytest.approx(then.distance(now))
        else:
            assert move.moved is None
    back = mapper.what_if(name)
    assert back is not None
    assert (back.action, back.components_after) == ("restore", answer.components_before)


def test_what_if_of_an_unknown_constraint_is_nothing(mapper: SiteMapper) -> None:
    assert mapper.what_if("p999-1000") is None


def test_forgetting_a_robot_is_as_if_it_had_never_been_here(
    mapper: SiteMapper, log: list[SimulatedScan]
) -> None:
    mapper.forget("robot-2")
    alone = mapped([s for s in log if s.robot == "robot-1"])
    a, b = mapper.view(), alone.view()
    assert (a.trajectories["robot-1"].poses == b.trajectories["robot-1"].poses).all()
    assert set(a.robots) == {"robot-1"}
    assert len(a.lines) == len(b.lines)
    assert a.merged_into == {}
