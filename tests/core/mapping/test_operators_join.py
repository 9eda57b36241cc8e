"""An operator says that two scans are near each other: measured, believed, explained, undone."""

from __future__ import annotations

from dataclasses import replace

import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.mapping.facts.ids import id_of
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.mapping.snapshot import Snapshot
from lineloom_lab.simulation import Fleet, SimulatedScan, rooms, sick_lms200

from tests.core.mapping.drives import component_error, feed, fingerprint, mapped

OFF = Pose(0.5, -0.3, 0.12)
"""How badly the operator's hand lays one map on the other."""


@pytest.fixture(scope="module")
def log() -> list[SimulatedScan]:
    """Two robots in four rooms that nothing has joined yet, though both saw the same."""
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=34.0, lidar=sick_lms200())
    return list(fleet.scans())


@pytest.fixture(scope="module")
def snapshot(log: list[SimulatedScan]) -> Snapshot:
    mapper = mapped(log)
    for c in mapper.view().constraints:
        if c.kind == "rendezvous" and c.state == "accepted":
            mapper.retract(c.id)
    return mapper.snapshot()


@pytest.fixture
def mapper(snapshot: Snapshot) -> SiteMapper:
    return SiteMapper.resume(snapshot)


def nearest(log: list[SimulatedScan]) -> tuple[SimulatedScan, SimulatedScan]:
    """The two scans of different robots that were taken nearest to each other."""
    robots = sorted({s.robot for s in log})
    mine, theirs = ([s for s in log if s.robot == name][::5] for name in robots)
    pairs = ((a, b) for a in mine for b in theirs)
    return min(pairs, key=lambda p: p[0].true_pose.distance(p[1].true_pose))


@pytest.fixture(scope="module")
def claim(log: list[SimulatedScan]) -> Claim:
    a, b = nearest(log)
    names = [ScanName(s.robot, s.scan.session, s.scan.seq) for s in (a, b)]
    T_a_b = a.true_pose.between(b.true_pose) @ OFF
    return Claim(id_of("operator", *names), "operator", "operator", names[0], names[1], T_a_b)


def said(view: SiteView, claim: Claim) -> str:
    return next(c.state for c in view.constraints if c.id == claim.constraint)


def test_it_joins_two_maps_as_the_scans_say(
    mapper: SiteMapper, log: list[SimulatedScan], claim: Claim
) -> None:
    assert len(mapper.view().components) == 2
    mapper.join(claim)
    view = mapper.view()
    assert len(view.components) == 1
    assert component_error(view, log).rmse < 0.1
    found = next(c for c in view.constraints if c.id == claim.constraint)
    assert (found.kind, found.state) == ("operator", "accepted")
    assert found.checks["snapped_m"] > 0.3
    assert found.reason == "said by an operator, and the scans agree"


def test_what_it_would_be_is_told_and_changes_nothing(mapper: SiteMapper, claim: Claim) -> None:
    before = fingerprint(mapper.view())
    trial = mapper.try_join(claim, guessed=True)
    assert trial is not None
    assert trial.fits
    assert not trial.objections
    assert trial.component_a != trial.component_b
    assert trial.evidence.limits["conflict_share"].holds
    assert trial.evidence.matched
    assert fingerprint(mapper.view()) == before
    mapper.join(claim)
    found = next(c for c in mapper.view().constraints if c.id == claim.constraint)
    assert found.T_a_b == trial.T_a_b


def test_without_a_pose_the_matcher_finds_one(mapper: SiteMapper, claim: Claim) -> None:
    free = mapper.try_join(replace(claim, T_a_b=Pose.identity()), guessed=False)
    near = mapper.try_join(claim, guessed=True)
    assert free is not None
    assert near is not None
    assert free.T_a_b.distance(near.T_a_b) < 0.05


def test_a_false_one_says_what_speaks_against_it(mapper: SiteMapper, claim: Claim) -> None:
    false = replace(claim, T_a_b=claim.T_a_b @ Pose(0.0, 3.0, 1.0))
    trial = mapper.try_join(false, guessed=True)
    assert trial is not None
    assert trial.objections or not trial.fits


def test_undoing_it_leaves_no_trace_and_redoing_it_all(mapper: SiteMapper, claim: Claim) -> None:
    apart = fingerprint(mapper.view())
    mapper.join(claim)
    joined = fingerprint(mapper.view())
    mapper.retract(claim.constraint)
    view = mapper.view()
    assert said(view, claim) == "retracted"
    rest = tuple(c for c in view.constraints if c.id != claim.constraint)
    assert fingerprint(replace(view, constraints=rest))[1:] == apart[1:]
    what_if = mapper.what_if(claim.constraint)
    assert what_if is not None
    assert len(what_if.components_after) == 1
    mapper.restore(claim.constraint)
    assert said(mapper.view(), claim) == "accepted"
    assert fingerprint(mapper.view())[1:] == joined[1:]


def test_it_holds_in_snapshots_and_while_more_is_seen(
    mapper: SiteMapper, log: list[SimulatedScan], claim: Claim
) -> None:
    mapper.join(claim)
    resumed = SiteMapper.resume(mapper.snapshot())
    assert fingerprint(resumed.view()) == fingerprint(mapper.view())
    feed(resumed, log[-40:])
    assert said(resumed.view(), claim) == "accepted"


def test_a_candidate_is_confirmed_under_its_own_name(
    mapper: SiteMapper, log: list[SimulatedScan]
) -> None:
    view = mapper.view()
    c = next(c for c in view.constraints if c.kind == "rendezvous" and c.state == "rejected")
    mapper.join(replace(c.claim, kind="operator"))
    view = mapper.view()
    now = next(k for k in view.constraints if k.id == c.id)
    assert (now.kind, now.state, now.origin) == ("operator", "accepted", "recognition")
    assert [h.state for h in now.history][-1] == "accepted"
    assert len(now.history) > 1
    assert len(view.components) == 1


def test_scans_that_nobody_knows_are_told_of_in_health(mapper: SiteMapper, claim: Claim) -> None:
    unknown = replace(claim, scan_a=replace(claim.scan_a, session="never"))
    version = mapper.version
    mapper.join(unknown)
    assert mapper.version == version + 1
    assert len(mapper.view().components) == 2
    assert mapper.try_join(unknown, guessed=True) is None


def test_forgetting_a_robot_forgets_what_was_said_of_it(mapper: SiteMapper, claim: Claim) -> None:
    mapper.join(claim)
    mapper.forget(claim.scan_b.robot)
    assert not mapper.verdicts.joined
