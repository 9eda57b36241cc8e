"""Asking the map where a scan was taken: right where it is sure, and it says where it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.localisation import Localisation, PoseHypothesis
from lineloom_core.mapping.answers.localise_score import descriptors, probability
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Scan
from lineloom_lab.simulation import (
    SimulatedRobot,
    SimulatedScan,
    World,
    long_corridor,
    rooms,
    sick_lms200,
)

from tests.core.mapping.drives import covered, empty, feed, fingerprint

WORLD = rooms(3)


def drive(world: World, seed: int, duration_s: float = 60.0) -> list[SimulatedScan]:
    robot = SimulatedRobot.wandering(
        "r", world, lidar=sick_lms200(), seed=seed, duration_s=duration_s
    )
    return list(robot.scans())


@pytest.fixture(scope="module")
def charted() -> tuple[SiteMapper, Pose]:
    """A map of the four rooms and T_map_world."""
    scans = drive(WORLD, 1, 90.0)
    mapper = SiteMapper()
    feed(mapper, scans)
    return mapper, scans[0].true_pose.inverse()


@pytest.fixture(scope="module")
def asked() -> list[SimulatedScan]:
    """Another robot's drive through the same rooms."""
    return drive(WORLD, 8, 40.0)


def off(h: PoseHypothesis, T_map_world: Pose, true: Pose) -> tuple[float, float]:
    error = h.pose.between(T_map_world @ true)
    return float(np.hypot(error.x, error.y)), abs(error.theta)


def same(a: Localisation, b: Localisation) -> bool:
    rows = [
        (
            r.verdict,
            r.reason,
            r.scan,
            [(h.component, h.pose, h.covariance.tobytes(), h.checks) for h in r.hypotheses],
        )
        for r in (a, b)
    ]
    return rows[0] == rows[1]


def test_single_scans_are_found_where_they_were_taken(
    charted: tuple[SiteMapper, Pose], asked: list[SimulatedScan]
) -> None:
    mapper, T_map_world = charted
    unique = 0
    for s in asked[:: len(asked) // 20]:
        found = mapper.localise([s.scan])
        if found.verdict == "unique":
            unique += 1
            distance, turn = off(found.hypotheses[0], T_map_world, s.true_pose)
            assert distance < 0.15
            assert turn < 0.03
            assert found.scan == 0
    assert unique >= 10


def test_a_run_says_where_its_latest_scan_was_taken(
    charted: tuple[SiteMapper, Pose], asked: list[SimulatedScan]
) -> None:
    mapper, T_map_world = charted
    run = asked[40:140]
    found = mapper.localise([s.scan for s in run])
    assert found.verdict == "unique"
    assert found.scan == len(run) - 1
    best = found.hypotheses[0]
    assert off(best, T_map_world, run[-1].true_pose)[0] < 0.15
    assert best.component == mapper.view().components[0].id
    assert np.linalg.eigvalsh(best.covariance).min() > 0.0
    assert np.sqrt(best.covariance[0, 0]) < 0.1
    assert best.score == probability(best.checks) > 0.9


def test_more_scans_are_more_evidence(
    charted: tuple[SiteMapper, Pose], asked: list[SimulatedScan]
) -> None:
    mapper, _ = charted
    run = [s.scan for s in asked[40:140]]
    one, many = mapper.localise(run[-1:]), mapper.localise(run)
    assert many.hypotheses[0].checks["matched"] > one.hypotheses[0].checks["matched"]


def test_scans_that_show_nothing_are_passed_over(
    charted: tuple[SiteMapper, Pose], asked: list[SimulatedScan]
) -> None:
    mapper, T_map_world = charted
    run = [s.scan for s in asked[40:140]]
    found = mapper.localise([*run, empty(run[-1]), covered(run[-1])])
    assert found.scan == len(run) - 1
    assert off(found.hypotheses[0], T_map_world, asked[139].true_pose)[0] < 0.15


def test_a_clockwise_sweep_is_the_same_scan(
    charted: tuple[SiteMapper, Pose], asked: list[SimulatedScan]
) -> None:
    mapper, _ = charted
    scan = asked[60].scan
    reversed_ = replace(
        scan,
        ranges=np.ascontiguousarray(scan.ranges[::-1]),
        angle_min=scan.angle_min + (len(scan) - 1) * scan.angle_increment,
        angle_increment=-scan.angle_increment,
    )
    a, b = mapper.localise([scan]).hypotheses[0], mapper.localise([reversed_]).hypotheses[0]
    assert a.pose.distance(b.pose) < 1e-6


def test_asking_changes_nothing_and_is_repeatable(
    charted: tuple[SiteMapper, Pose], asked: list[SimulatedScan]
) -> None:
    mapper, _ = charted
    before, snapshot = fingerprint(mapper.view()), mapper.snapshot()
    run = [s.scan for s in asked[40:100]]
    first = mapper.localise(run)
    assert same(first, mapper.localise(run))
    assert same(first, SiteMapper.resume(snapshot).localise(run))
    assert fingerprint(mapper.view()) == before
    assert mapper.snapshot() == snapshot


@pytest.mark.parametrize("scans", [[], [empty(drive(WORLD, 1, 0.5)[0].scan)]])
def test_nothing_to_go_by_is_unknown(charted: tuple[SiteMapper, Pose], scans: list[Scan]) -> None:
    found = charted[0].localise(scans)
    assert (found.verdict, found.hypotheses, found.scan) == ("unknown", (), None)
    assert found.reason


def test_an_empty_map_knows_no_place(asked: list[SimulatedScan]) -> None:
    found = SiteMapper().localise([asked[0].scan])
    assert (found.verdict, found.hypotheses) == ("unknown", ())


def test_another_building_is_never_found_in_this_one(charted: tuple[SiteMapper, Pose]) -> None:
    elsewhere = drive(rooms(11), 2, 60.0)
    for begin in range(0, len(elsewhere) - 30, 60):
        run = [s.scan for s in elsewhere[begin : begin + 30]]
        assert charted[0].localise(run).verdict != "unique"
        assert charted[0].localise(run[:1]).verdict != "unique"


def test_a_corridor_that_repeats_itself_is_ambiguous() -> None:
    world = long_corridor()
    way = [(3.0, 1.1), (40.0, 1.1), (5.0, 1.1)]
    mapper = SiteMapper()
    feed(mapper, SimulatedRobot.through("r", world, way, lidar=sick_lms200(), seed=1).scans())
    other = SimulatedRobot.through(
        "q", world, [(18.0, 1.0), (24.0, 1.0)], lidar=sick_lms200(), seed=4
    )
    run = [s.scan for s in other.scans()]
    for scans in (run, run[:1], run[-1:]):
        found = mapper.localise(scans)
        assert found.verdict == "ambiguous"
        assert len(found.hypotheses) > 2
        evidence = [h.checks["evidence"] for h in found.hypotheses]
        assert evidence == sorted(evidence, reverse=True)


def test_the_score_grows_with_what_speaks_for_a_spot() -> None:
    checks = {
        "evidence": 30.0,
        "explained": 0.8,
        "conflict_share": 0.02,
        "margin": 0.7,
        "places": 10.0,
        "information": 2e4,
        "isotropy": 0.5,
    }
    p = probability(checks)
    assert 0.0 < p < 1.0
    for name, value in (("evidence", 60.0), ("explained", 1.0), ("margin", 1.0), ("places", 20.0)):
        assert probability({**checks, name: value}) > p
    for name, value in (("conflict_share", 0.2), ("margin", -1.0)):
        assert probability({**checks, name: value}) < p
    assert np.all(np.isfinite(descriptors({**checks, "evidence": -5.0, "information": 0.0})))
