"""Every constraint can say what speaks for it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.io.evidence_drawing import draw_evidence
from lineloom_core.io.svg import to_svg
from lineloom_core.mapping.answers.evidence import Evidence
from lineloom_core.mapping.answers.site_view import ConstraintView
from lineloom_core.mapping.belief.claim import Origin
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_lab.simulation import (
    Fleet,
    SimulatedRobot,
    SimulatedScan,
    corridors,
    rooms,
    sick_lms200,
)

from tests.core.mapping.drives import fingerprint, mapped


@pytest.fixture(scope="module")
def mapper() -> SiteMapper:
    """Two robots in four rooms; they meet after half a minute."""
    fleet = Fleet.touring(rooms(2), robots=2, seed=2, duration_s=50.0, lidar=sick_lms200())
    return mapped(list(fleet.scans()))


ORIGINS: tuple[Origin, ...] = ("near", "step")


def explained(
    mapper: SiteMapper, origin: Origin, state: str
) -> list[tuple[ConstraintView, Evidence]]:
    rows = []
    for c in mapper.view().constraints:
        if c.origin == origin and c.state == state:
            evidence = mapper.explain(c.id)
            assert evidence is not None
            rows.append((c, evidence))
    assert rows, (origin, state)
    return rows


def test_an_accepted_recognition_shows_walls_that_lie_on_each_other(mapper: SiteMapper) -> None:
    for c, evidence in explained(mapper, "recognition", "accepted"):
        assert len(evidence.matched) >= 3
        for pair in evidence.matched:
            assert pair.distance < 0.25
            assert pair.angle < 0.12
            assert pair.overlap > 0.2
        judged = c.checks["matched"] + c.checks["conflict"]
        assert len(evidence.conflicts) <= 0.2 * judged
        assert evidence.votes is not None
        assert evidence.votes > 0.0
        assert evidence.margin == c.checks["margin"]
        names = ["matched", "overlap", "margin"]
        if c.kind == "rendezvous":
            names += ["set_size", "set_evidence", "rival_evidence", "map_missing", "doubt"]
        for name in names:
            assert evidence.limits[name].holds, (name, c.checks[name])


def test_a_refused_recognition_fails_the_check_it_names() -> None:
    """One robot each in two buildings: what is recognised is refused, and says why."""
    log = [
        SimulatedScan(name, s.scan, s.true_pose, s.time_s)
        for name, world in (("a", rooms(2)), ("b", corridors(1)))
        for s in SimulatedRobot.wandering(
            name, world, lidar=sick_lms200(), seed=3, duration_s=50.0
        ).scans()
    ]
    rows = explained(mapped(log), "recognition", "rejected")
    at_first = ("matched", "overlap", "conflict_share", "margin", "information")
    for c, evidence in rows:
        assert any(not evidence.limits[name].holds for name in at_first), c.reason


def test_loops_and_steps_are_explained_too(mapper: SiteMapper) -> None:
    for origin in ORIGINS:
        for c, evidence in explained(mapper, origin, "accepted")[:10]:
            assert evidence.matched
            assert all(limit.holds for limit in evidence.limits.values()), c
            assert (evidence.votes, evidence.runner_up) == (None, None)


def test_matched_walls_are_the_same_from_either_side(mapper: SiteMapper) -> None:
    """In the frame of keyframe a the matched lines lie on each other, whatever that frame is."""
    for _, evidence in explained(mapper, "recognition", "accepted"):
        for pair in evidence.matched:
            p, q = np.array(pair.reference[:2]), np.array(pair.reference[2:])
            u = (q - p) / np.linalg.norm(q - p)
            middle = 0.5 * (np.array(pair.current[:2]) + np.array(pair.current[2:])) - p
            assert abs(u[0] * middle[1] - u[1] * middle[0]) == pytest.approx(pair.distance)


def test_a_runner_up_is_another_pose(mapper: SiteMapper) -> None:
    config = mapper.config.recognition
    for c, evidence in explained(mapper, "recognition", "accepted"):
        if evidence.runner_up is None:
            continue
        apart = math.hypot(evidence.runner_up.x - c.T_a_b.x, evidence.runner_up.y - c.T_a_b.y)
        turned = abs(math.remainder(evidence.runner_up.theta - c.T_a_b.theta, 2.0 * math.pi))
        # Rivals are told apart between the places' anchors; the lever to the keyframes is short.
        assert apart > 0.1 * config.rival_distance or turned > 0.5 * config.rival_angle


def test_explaining_changes_nothing_and_unknown_ones_are_none(mapper: SiteMapper) -> None:
    before = fingerprint(mapper.view())
    assert mapper.explain("p98-99") is None
    explained(mapper, "recognition", "accepted")
    assert fingerprint(mapper.view()) == before


def test_the_drawing_shows_both_places_and_every_figure(mapper: SiteMapper) -> None:
    c, evidence = explained(mapper, "recognition", "accepted")[0]
    text = to_svg(draw_evidence(c, evidence))
    for name in c.checks:
        assert evidence.limits[name].means in text
    assert text.count("<path") == 2 + len(evidence.matched)
