"""Joining two components: what convinces, what does not, and that it is then right."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from lineloom_core.checks import JOINED
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph.growth import Growth
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import JoinConfig, MapperConfig
from lineloom_core.mapping.merging import distinctive, weighing
from lineloom_core.mapping.merging.component_merged import ComponentMerged
from lineloom_core.mapping.merging.joining import join
from lineloom_core.places import Place
from lineloom_lab.simulation import SimulatedRobot, SimulatedScan, rooms, sick_lms200

from tests.core.graph.dense_twins import chi2
from tests.core.mapping.sites import lay_places, lay_track, link, thinned

BEGIN_B = Pose(7.0, -3.0, 1.0)
"""Where the second component's frame puts its robot: as arbitrary as such frames are."""
STRONG = 150.0
"""Metres of wall: more than any two places of these rooms have in common by mistake."""


@dataclass
class Meeting:
    """Two robots that drove the same way and have not been joined."""

    site: SiteMap
    a: list[int]
    b: list[int]
    places_a: list[Place]
    places_b: list[Place]

    def candidate(
        self, i: int, off: Pose | None = None, *, turned: bool = False, evidence: float = STRONG
    ) -> Constraint:
        """A candidate between the i-th places of both; `off`: T_true_said at b's end."""
        a, b = self.places_a[i], self.places_b[i]
        T_a_b = self.true(a.anchor).between(self.true(b.anchor)) @ (off or Pose.identity())
        if turned:
            T_b_a = T_a_b.inverse()
            return link(
                self.site, b.anchor, a.anchor, T_b_a, places=(b.id, a.id), evidence=evidence
            )
        return link(self.site, a.anchor, b.anchor, T_a_b, places=(a.id, b.id), evidence=evidence)

    def true(self, keyframe: int) -> Pose:
        """Where the keyframe is in the frame that both have in truth."""
        return self.site.keyframes[keyframe].T_track_laser

    def join(self) -> ComponentMerged | None:
        return join(self.site, self.a[0], self.b[-1])

    def worst_error(self) -> float:
        return max(self.site.pose(k).distance(self.true(k)) for k in self.a + self.b)


@pytest.fixture(scope="module")
def drives() -> tuple[list[SimulatedScan], list[SimulatedScan]]:
    robot = SimulatedRobot.wandering("a", rooms(2), lidar=sick_lms200(), seed=3, duration_s=60.0)
    first, second = list(robot.scans()), list(replace(robot, name="b", seed=77).scans())
    return thinned(first), thinned(second)


@pytest.fixture
def meeting(drives: tuple[list[SimulatedScan], list[SimulatedScan]]) -> Meeting:
    site = SiteMap(MapperConfig())
    a = lay_track(site, drives[0], robot="a")
    b = lay_track(site, drives[1], robot="b", begin=BEGIN_B)
    return Meeting(site, a, b, lay_places(site, a), lay_places(site, b))


def spread(meeting: Meeting, count: int) -> Sequence[int]:
    """Numbers of places that lie all over the drive."""
    last = len(meeting.places_a) - 1
    return [int(i) for i in np.linspace(0, last, count)]


def test_three_that_agree_join_two_robots_where_they_are(meeting: Meeting) -> None:
    made = [meeting.candidate(i) for i in spread(meeting, 3)]
    names = tuple(meeting.site.component_id(track[0]) for track in (meeting.a, meeting.b))
    merged = meeting.join()
    assert merged is not None
    assert (merged.survivor, merged.absorbed) == names
    assert sorted(merged.constraints) == sorted(c.id for c in made)
    assert meeting.site.merged_into == {names[1]: names[0]}
    assert meeting.worst_error() < 0.01
    for name in merged.constraints:
        stored = meeting.site.constraints[name]
        assert (stored.state, stored.consistency_set) == ("accepted", merged.constraints)
        assert stored.checks["map_missing"] < 0.01
        assert stored.checks["set_missing"] < 0.01


def test_small_disagreement_is_averaged_not_refused(meeting: Meeting) -> None:
    rng = np.random.default_rng(5)
    for i in spread(meeting, 4):
        meeting.candidate(i, Pose(*rng.normal(0.0, [0.03, 0.03, 0.005])))
    assert meeting.join() is not None
    assert meeting.worst_error() < 0.12


def test_no_more_is_held_against_whole_maps_than_it_takes(
    meeting: Meeting, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = [meeting.candidate(i, evidence=STRONG + i) for i in spread(meeting, 5)]
    asked: list[str] = []

    def is_distinctive(site: SiteMap, candidate: Constraint) -> bool:
        asked.append(candidate.id)
        return distinctive.is_distinctive(site, candidate)

    monkeypatch.setattr(weighing, "is_distinctive", is_distinctive)
    assert meeting.join() is not None
    assert set(asked) == {c.id for c in made[-2:]}


@pytest.mark.parametrize("count", [0, 1])
def test_a_single_one_joins_nothing(meeting: Meeting, count: int) -> None:
    for i in list(spread(meeting, 3))[:count]:
        meeting.candidate(i)
    assert meeting.join() is None
    assert not meeting.site.same_component(meeting.a[0], meeting.b[0])
    assert all(c.state == "candidate" for c in meeting.site.constraints.values() if c.evidence > 99)


def test_three_that_contradict_each_other_join_nothing(meeting: Meeting) -> None:
    for i, off in zip(
        spread(meeting, 3), (Pose(0, 0, 0), Pose(2, 0, 0), Pose(0, 0, 1)), strict=True
    ):
        meeting.candidate(i, off)
    assert meeting.join() is None


def test_little_evidence_joins_nothing(meeting: Meeting) -> None:
    for i in spread(meeting, 3):
        meeting.candidate(i, evidence=6.0)
    assert meeting.join() is None
    assert said(meeting) == {"too little evidence in all"}


def said(meeting: Meeting) -> set[str]:
    """What the open candidates say they wait for."""
    constraints = meeting.site.constraints.values()
    return {c.reason for c in constraints if c.state == "candidate"}


def shifted(meeting: Meeting, i: int, T: Pose, evidence: float) -> Constraint:
    """A candidate of a rival story: the whole second map moved by T in the first one's frame."""
    a, b = meeting.places_a[i], meeting.places_b[i]
    T_a_b = meeting.true(a.anchor).between(T @ meeting.true(b.anchor))
    return link(meeting.site, a.anchor, b.anchor, T_a_b, places=(a.id, b.id), evidence=evidence)


def test_a_rival_story_with_as_much_evidence_blocks(meeting: Meeting) -> None:
    for i in spread(meeting, 3):
        meeting.candidate(i)
        shifted(meeting, i, Pose(0.0, 3.0, 0.0), STRONG)
    assert meeting.join() is None


def test_a_weak_rival_does_not_block_and_is_rejected(meeting: Meeting) -> None:
    right = [meeting.candidate(i) for i in spread(meeting, 4)]
    wrong = shifted(meeting, 1, Pose(0.0, 3.0, 0.0), 30.0)
    merged = meeting.join()
    assert merged is not None
    assert set(merged.constraints) == {c.id for c in right}
    assert meeting.site.constraints[wrong.id].state == "rejected"
    assert wrong.id not in meeting.site.graph.edges
    assert meeting.worst_error() < 0.01


@pytest.mark.parametrize("T", [Pose(1.5, 0, 0), Pose(0, -2.0, 0), Pose(12.0, 5.0, 3.14)])
def test_a_story_that_puts_walls_into_free_space_is_refused(meeting: Meeting, T: Pose) -> None:
    # All agree, all claim plenty: only the two maps themselves can object.
    for i in spread(meeting, 4):
        shifted(meeting, i, T, STRONG)
    assert meeting.join() is None
    assert {reason.partition(" (")[0] for reason in said(meeting)} <= {
        "what stood still for one is missing for the other",
        "the maps contradict each other there",
    }
    assert not meeting.site.same_component(meeting.a[0], meeting.b[0])


def test_a_small_overlap_is_doubted_until_more_is_seen(
    drives: tuple[list[SimulatedScan], list[SimulatedScan]],
) -> None:
    site = SiteMap(MapperConfig(join=JoinConfig(most_false=0.003)))
    a = lay_track(site, drives[0], robot="a")
    b = lay_track(site, drives[1], robot="b", begin=BEGIN_B)
    made = Meeting(site, a, b, lay_places(site, a), lay_places(site, b))
    waiting = [made.candidate(i) for i in spread(made, 3)]
    assert made.join() is None
    (reason,) = said(made)
    assert re.fullmatch(r"it may be false \(\d\.\d%\): \d+ m more of common wall", reason)
    for c in waiting:
        shown = site.constraints[c.id].checks
        assert {row.name for row in JOINED.rows} <= shown.keys()
        assert shown["doubt"] > 0.003
    for i in range(len(made.places_a)):
        made.candidate(i)
    assert made.join() is not None
    assert made.worst_error() < 0.01
    for c in waiting:
        assert site.constraints[c.id].checks["doubt"] < 0.003


def test_places_that_look_like_others_nearby_prove_nothing(
    meeting: Meeting, monkeypatch: pytest.MonkeyPatch
) -> None:
    for i in spread(meeting, 4):
        meeting.candidate(i)
    elsewhere = np.zeros((1, 10))  # as if each were found elsewhere, with as much evidence
    elsewhere[0, :3] = 100.0, 100.0, 2.0
    elsewhere[0, 9] = STRONG
    for tables in ("hypotheses", "look_alikes"):
        monkeypatch.setattr(meeting.site.memory, tables, lambda a, b: elsewhere)
    assert meeting.join() is None
    assert said(meeting) == {"the places look like others of the same robots"}


def test_a_candidate_says_the_same_from_either_end(
    drives: tuple[list[SimulatedScan], list[SimulatedScan]],
) -> None:
    poses = []
    for turned in ((False, False, False), (True, True, True), (True, False, True)):
        site = SiteMap(MapperConfig())
        a = lay_track(site, drives[0], robot="a")
        b = lay_track(site, drives[1], robot="b", begin=BEGIN_B)
        made = Meeting(site, a, b, lay_places(site, a), lay_places(site, b))
        offs = (Pose(0.02, 0.01, 0.004), Pose(-0.03, 0.0, 0.0), Pose(0.0, 0.02, -0.003))
        for i, off, way in zip(spread(made, 3), offs, turned, strict=True):
            made.candidate(i, off, turned=way)
        assert made.join() is not None
        poses.append(np.array([site.pose(k).to_array() for k in a + b]))
    # Not exactly: the information was given in the axes of one end, isotropic but for the lever.
    np.testing.assert_allclose(poses[1], poses[0], atol=5e-3)
    np.testing.assert_allclose(poses[2], poses[0], atol=5e-3)


def test_turning_a_candidate_round_keeps_its_cost(meeting: Meeting) -> None:
    """What it charges for a small error must not depend on which end it is written from."""
    rng = np.random.default_rng(2)
    A = rng.normal(size=(3, 3))
    given = link(
        meeting.site,
        meeting.b[4],
        meeting.a[9],
        meeting.true(meeting.b[4]).between(meeting.true(meeting.a[9])),
        places=(meeting.places_b[0].id, meeting.places_a[1].id),
        information=1e4 * (A @ A.T + np.eye(3)),
        evidence=STRONG,
    )
    for i in spread(meeting, 3):
        meeting.candidate(i)
    assert meeting.join() is not None
    stored = meeting.site.constraints[given.id]
    assert (stored.keyframe_a, stored.keyframe_b) == (meeting.a[9], meeting.b[4])
    for _ in range(10):
        step = Pose.from_array(rng.normal(0.0, 1e-3, 3))
        before, after = (squared_error(c, meeting, given.T_a_b @ step) for c in (given, stored))
        assert after == pytest.approx(before, rel=0.02)


def squared_error(c: Constraint, meeting: Meeting, T_b_a: Pose) -> float:
    """A constraint's whitened error between b[4] and a[9], written either way round."""
    poses = {meeting.b[4]: Pose.identity(), meeting.a[9]: T_b_a}
    row = {meeting.b[4]: 0, meeting.a[9]: 1}
    edge = replace(c.edge(), node_a=row[c.keyframe_a], node_b=row[c.keyframe_b])
    pair = Growth.of(np.arange(2), se2.stack(poses.values()), [edge])
    return float(chi2(pair, pair.poses)[0])
