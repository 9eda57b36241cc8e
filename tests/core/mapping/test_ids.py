"""Ids derive from the scans that things rest on, and verdicts outlive a replay by them."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.site_view import ConstraintView, SiteView
from lineloom_core.mapping.belief.claim import Claim, Origin
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.ids import id_of
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import (
    Fleet,
    SimulatedRobot,
    SimulatedScan,
    corridors,
    rooms,
    sick_lms200,
)

from tests.core.mapping.drives import empty, feed, fingerprint, mapped

_TRACKER = replace(MapperConfig().tracker, keyframe_distance=0.5)
WIDER = MapperConfig(tracker=_TRACKER)
LATE = 117
"""Number of the entry that is missing at first."""


@pytest.fixture(scope="module")
def log() -> list[SimulatedScan]:
    """Two robots in four rooms; they meet after half a minute."""
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=50.0, lidar=sick_lms200())
    return list(fleet.scans())


@pytest.fixture(scope="module")
def shown(log: list[SimulatedScan]) -> SiteView:
    """The map that an operator has before him: one scan has not come yet."""
    return mapped(log[:LATE] + log[LATE + 1 :]).view()


@pytest.fixture(scope="module")
def replays(log: list[SimulatedScan]) -> dict[str, SiteMapper]:
    """What other ways of going through the log give."""
    stranger = SimulatedRobot.wandering(
        "a stranger", corridors(4), lidar=sick_lms200(), seed=5, duration_s=12.0
    )
    wider = SiteMapper(WIDER)
    feed(wider, log)
    return {
        "a late scan": mapped(log),
        "other parameters": wider,
        "other numbers": mapped([*stranger.scans(), *log[:LATE], *log[LATE + 1 :]]),
    }


def chosen(view: SiteView, origin: Origin, replay: SiteView | None = None) -> ConstraintView:
    """One in the middle of those that are believed, or the last that makes two maps one.

    replay: it says the same there, or the test would show nothing.
    """
    found = [c for c in view.constraints if c.origin == origin and c.state == "accepted"]
    if origin == "recognition":  # a loop that was found afterwards takes no map apart
        found = [c for c in found if c.kind == "rendezvous"]
    middle = len(found) - 1 if origin == "recognition" else len(found) // 2
    order = sorted(range(len(found)), key=lambda i: abs(i - middle))
    return next(found[i] for i in order if replay is None or alike(replay, found[i].claim))


def alike(view: SiteView, claim: Claim) -> list[ConstraintView]:
    """The believed constraints that say what was retracted, found by the scans' numbers alone."""
    found = []
    for c in view.constraints:
        if c.state != "accepted" or c.origin != claim.origin:
            continue
        if claim.origin == "step" and not claim.scan_b.lies_between(c.scan_a, c.scan_b):
            continue
        if claim.origin == "near" and not (
            _near(c.scan_a, claim.scan_a) and _near(c.scan_b, claim.scan_b)
        ):
            continue
        if claim.origin == "recognition" and {c.scan_a.robot, c.scan_b.robot} != {
            claim.scan_a.robot,
            claim.scan_b.robot,
        }:
            continue
        found.append(c)
    return found


def _near(a: ScanName, b: ScanName) -> bool:
    """Within what a robot drives in half a second."""
    return (a.robot, a.session) == (b.robot, b.session) and abs(a.seq - b.seq) <= 3


@pytest.mark.parametrize("replay", ["a late scan", "other parameters", "other numbers"])
@pytest.mark.parametrize("origin", ["step", "near", "recognition"])
def test_what_was_retracted_is_out_in_every_replay_until_it_is_restored(
    shown: SiteView, replays: dict[str, SiteMapper], origin: Origin, replay: str
) -> None:
    mapper = SiteMapper.resume(replays[replay].snapshot())
    before = mapper.view()
    claim = chosen(shown, origin, before).claim
    mapper.retract(claim)
    after = mapper.view()
    assert alike(after, claim) == []
    assert [c.id for c in after.constraints if c.state == "retracted"] == [claim.constraint]
    resumed = SiteMapper.resume(mapper.snapshot())
    assert fingerprint(resumed.view()) == fingerprint(after)
    mapper.restore(claim)
    assert fingerprint(replace(mapper.view(), version=0)) == fingerprint(replace(before, version=0))


@pytest.mark.parametrize("replay", ["a late scan", "other parameters"])
def test_a_recognised_loop_that_was_retracted_is_out_in_every_replay(replay: str) -> None:
    """One robot comes back to where it began, and sees that it does."""
    stops = [(2.0, 2.0), (11.5, 2.2), (11.3, 8.0), (2.2, 7.8), (2.0, 2.0), (2.2, 7.8)]
    robot = SimulatedRobot.through("r", rooms(2), stops, lidar=sick_lms200(), seed=2)
    drive = list(robot.scans())[:420]
    shown = mapped(drive[:LATE] + drive[LATE + 1 :]).view()
    loops = [c for c in shown.constraints if c.origin == "recognition" and c.state == "accepted"]
    claim = loops[0].claim  # what came before a retracted loop stays
    assert claim.kind == "loop"
    mapper = SiteMapper(WIDER) if replay == "other parameters" else SiteMapper()
    feed(mapper, drive)
    before = mapper.view()
    assert alike(before, claim)
    mapper.retract(claim)
    view = mapper.view()
    assert alike(view, claim) == []
    assert [c.id for c in view.constraints if c.state == "retracted"] == [claim.constraint]
    mapper.restore(claim)
    assert fingerprint(replace(mapper.view(), version=0)) == fingerprint(replace(before, version=0))


def test_what_is_said_of_scans_that_are_in_no_map_is_told(log: list[SimulatedScan]) -> None:
    scans = [s for s in log if s.robot == "robot-1"][:60]
    later = [replace(s, scan=replace(empty(s.scan), session="later")) for s in scans[:3]]
    mapper = mapped([*scans, *later])
    ends = (ScanName("robot-1", "0", 10), ScanName("robot-1", "later", 1))
    claim = Claim(id_of("near", *ends), "loop", "near", *ends, Pose.identity())
    before = mapper.view()
    assert before.robots["robot-1"].health == ()
    mapper.retract(claim)
    (finding,) = mapper.view().robots["robot-1"].health
    assert finding.startswith(f"no-effect: what was said of constraint {claim.constraint} ")
    assert "'later'" in finding
    assert [c for c in mapper.view().constraints if c.state == "retracted"] == []
    resumed = SiteMapper.resume(mapper.snapshot())
    assert resumed.view().robots["robot-1"].health == (finding,)
    feed(resumed, [replace(s, scan=replace(s.scan, session="later")) for s in scans[3:20]])
    resumed.retract(claim)
    assert resumed.view().robots["robot-1"].health == (), "now it bars what says so"
    assert [c.id for c in resumed.view().constraints if c.state == "retracted"] == [
        claim.constraint
    ]


def test_ids_stay_whatever_the_order_of_the_log(
    shown: SiteView, replays: dict[str, SiteMapper]
) -> None:
    def ids(view: SiteView) -> set[str]:
        # Which near loops are looked for after a merge goes by the keyframes' numbers.
        constraints = {c.id for c in view.constraints if c.origin != "near"}
        placed = {k.id for k in view.keyframes} | {p.id for p in view.places}
        return constraints | placed | {c.id for c in view.components}

    assert len(ids(shown)) > 100
    assert ids(shown) < ids(replays["other numbers"].view())


def test_ids_are_fit_for_a_path_and_tell_everything_apart(shown: SiteView) -> None:
    ids = [k.id for k in shown.keyframes] + [c.id for c in shown.constraints]
    ids += [p.id for p in shown.places] + [c.id for c in shown.components]
    assert len(set(ids)) == len(ids)
    assert all(re.fullmatch(r"[krsnpc]-[a-z2-7]{16}", name) for name in ids)


def test_a_session_may_be_called_anything() -> None:
    names = [("r", "0", 1), ("r", "0,1", 1), ("r", '","', 1), ("r", "\ud800", 1), ("r", "é", 1)]
    ids = {id_of("keyframe", ScanName(*name)) for name in names}
    assert len(ids) == len(names)
    a, b = (ScanName(*name) for name in names[:2])
    assert id_of("near", a, b) == id_of("near", b, a)


def test_a_log_without_numbers_has_ids_all_the_same(log: list[SimulatedScan]) -> None:
    bare = [replace(s, scan=replace(s.scan, seq=0)) for s in log if s.robot == "robot-1"][:60]
    view = mapped(bare).view()
    assert len(view.keyframes) > 5
    assert len({k.id for k in view.keyframes}) == len(view.keyframes)


@pytest.mark.parametrize("origin", ["step", "near", "recognition"])
def test_a_former_versions_names_by_number_mean_what_they_meant(
    shown: SiteView, log: list[SimulatedScan], origin: Origin
) -> None:
    wanted = chosen(shown, origin)
    by_number, by_claim = (mapped(log[:LATE] + log[LATE + 1 :]) for _ in range(2))
    by_number.retract(_ordinal(wanted, shown))
    by_claim.retract(wanted.claim)
    assert fingerprint(by_number.view()) == fingerprint(by_claim.view())
    assert [c.id for c in by_number.view().constraints if c.state == "retracted"] == [wanted.id]
    by_number.restore(_ordinal(wanted, shown))
    assert fingerprint(replace(by_number.view(), version=0)) == fingerprint(
        replace(shown, version=0)
    )


def _ordinal(c: ConstraintView, view: SiteView) -> str:
    """What a former version called it: `s13`, `n3-40`, `p12-57`."""
    number = {k.id: i for i, k in enumerate(view.keyframes)}
    a, b = number[c.keyframe_a], number[c.keyframe_b]
    if c.origin != "recognition":
        return f"s{b}" if c.origin == "step" else f"n{a}-{b}"
    scans = {k.id: ScanName(k.robot, k.session, k.seq) for k in view.keyframes}
    last = [p.keyframes[-1] for p in view.places]
    ((a, b),) = (
        sorted((number[p], number[q]))
        for p, q in itertools.combinations(last, 2)
        if id_of("recognition", scans[p], scans[q]) == c.id
    )
    return f"p{a}-{b}"
