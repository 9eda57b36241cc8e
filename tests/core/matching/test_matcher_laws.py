"""What holds for every answer of the default matcher."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.matching import LineMatcher, MatchResult, match
from lineloom_core.scan import Scan
from lineloom_lab.evaluation import pose_error
from lineloom_lab.evaluation.simulated_pairs import SimulatedPair, simulated_pairs
from lineloom_lab.simulation import scanner_360, sick_lms200, world_named

MATCHER = LineMatcher()
LIDARS = {"half turn": (sick_lms200(), 30), "full turn": (scanner_360(), 12)}


@pytest.fixture(scope="module", params=list(LIDARS))
def pairs(request: pytest.FixtureRequest) -> list[SimulatedPair]:
    """Pairs of a furnished floor, a fifth of them of different places."""
    lidar, count = LIDARS[request.param]
    world, rng = world_named("office", 5), np.random.default_rng(5)
    return list(simulated_pairs(world, lidar, rng, count, negative_share=0.2, reach=2.0))


def turned(scan: Scan, angle: float) -> Scan:
    """The same sweep as a lidar would give it whose axes are turned by -angle."""
    return replace(scan, angle_min=scan.angle_min + angle)


def best(result: MatchResult) -> Pose:
    assert result.T_reference_current is not None
    return result.T_reference_current


def assert_near(a: Pose, b: Pose, metres: float, radians: float) -> None:
    error = pose_error(a, b)
    assert error.translation < metres, (a, b)
    assert error.rotation < radians, (a, b)


def answered(pairs: list[SimulatedPair]) -> list[tuple[SimulatedPair, MatchResult]]:
    results = [(p, MATCHER.match(p.reference, p.current)) for p in pairs]
    sure = [(p, r) for p, r in results if r.verdict == "match"]
    assert len(sure) >= 0.3 * len(pairs)
    return sure


@pytest.mark.parametrize("angle", [math.radians(37.0), -2.2, math.pi])
def test_turning_a_lidar_turns_the_answer(pairs: list[SimulatedPair], angle: float) -> None:
    """Neither the axes of the one nor those of the other mean anything."""
    R = Pose(0.0, 0.0, angle)
    same = 0
    sure = answered(pairs)
    for p, result in sure:
        other = MATCHER.match(turned(p.reference, angle), p.current)
        third = MATCHER.match(p.reference, turned(p.current, angle))
        assert_near(best(other), R @ best(result), 0.03, 0.01)
        assert_near(best(third), best(result) @ R.inverse(), 0.03, 0.01)
        same += other.verdict == third.verdict == "match"
    assert same >= 0.9 * len(sure)


def test_swapping_the_scans_inverts_the_answer(pairs: list[SimulatedPair]) -> None:
    sure = answered(pairs)
    same = 0
    for p, result in sure:
        back = MATCHER.match(p.current, p.reference)
        if back.verdict == "match":
            same += 1
            assert_near(best(back).inverse(), best(result), 0.06, 0.02)
            assert back.score == pytest.approx(result.score, abs=0.2)
    assert same >= 0.9 * len(sure)


def test_the_same_scans_give_the_same_answer_bit_for_bit(pairs: list[SimulatedPair]) -> None:
    for p in pairs:
        a = MATCHER.match(p.reference, p.current)
        b = LineMatcher().match(p.reference, p.current)
        assert (a.verdict, a.best, a.score, a.checks) == (b.verdict, b.best, b.score, b.checks)
        assert (a.pairs, a.alternatives, a.weak_direction) == (
            b.pairs,
            b.alternatives,
            b.weak_direction,
        )
        np.testing.assert_array_equal(a.covariance, b.covariance)


def test_a_scan_matches_itself_where_it_was_taken(pairs: list[SimulatedPair]) -> None:
    matches = 0
    for p in pairs:
        result = MATCHER.match(p.reference, p.reference)
        assert_near(best(result), Pose.identity(), 1e-3, 1e-3)
        assert result.checks["conflict_share"] == 0.0
        matches += result.verdict == "match"
    assert matches >= 0.8 * len(pairs)


def shuffled(f: ScanFeatures, rng: np.random.Generator) -> ScanFeatures:
    order = rng.permutation(len(f))
    return replace(f, lines=f.lines[order], ends=f.ends[order], edges=f.edges[order])


def test_the_order_of_the_lines_does_not_matter(pairs: list[SimulatedPair]) -> None:
    rng = np.random.default_rng(0)
    for p, result in answered(pairs):
        ref, cur = MATCHER.prepare(p.reference), MATCHER.prepare(p.current)
        other = MATCHER.match_prepared(shuffled(ref, rng), shuffled(cur, rng))
        assert other.verdict == result.verdict
        assert_near(best(other), best(result), 1e-6, 1e-6)
        assert other.score == pytest.approx(result.score, abs=1e-6)
        assert len(other.pairs) == len(result.pairs)


def test_preparing_first_makes_no_difference(pairs: list[SimulatedPair]) -> None:
    for p in pairs[:5]:
        direct = MATCHER.match(p.reference, p.current)
        assert match(MATCHER, p.reference, p.current).best == direct.best


def test_every_answer_is_complete(pairs: list[SimulatedPair]) -> None:
    verdicts = set()
    for p in pairs:
        r = MATCHER.match(p.reference, p.current)
        verdicts.add(r.verdict)
        assert 0.0 <= r.score <= 1.0
        assert r.reason
        assert (r.T_reference_current is None) == (r.verdict == "none") == (r.covariance is None)
        assert (r.weak_direction is not None) == (r.verdict == "weak")
        if r.weak_direction is not None:
            assert 0.0 <= r.weak_direction < math.pi
        if r.covariance is not None:
            np.testing.assert_allclose(r.covariance, r.covariance.T, rtol=1e-6)
            assert np.linalg.eigvalsh(r.covariance).min() > 0.0
    assert {"match", "none"} <= verdicts


def test_alternatives_are_other_places_and_no_better(pairs: list[SimulatedPair]) -> None:
    seen = 0
    for _, result in answered(pairs):
        for other in result.alternatives:
            error = pose_error(other.T_reference_current, best(result))
            assert error.translation > 0.3 or error.rotation > 0.15
            assert 0.0 <= other.score <= result.score
            seen += 1
    assert seen > 3


def test_pairs_of_lines_lie_on_each_other(pairs: list[SimulatedPair]) -> None:
    for p, result in answered(pairs):
        ref, cur = MATCHER.prepare(p.reference).lines, MATCHER.prepare(p.current).lines
        assert len(result.pairs) >= 2
        for pair in result.pairs:
            a, b = best(result).transform(cur[pair.current, :4].reshape(2, 2))
            start, end = ref[pair.reference, :4].reshape(2, 2)
            u = (end - start) / np.linalg.norm(end - start)
            off = 0.5 * (a + b) - start
            assert pair.distance == pytest.approx(abs(u[0] * off[1] - u[1] * off[0]), abs=1e-9)
            assert pair.distance < 0.12
            assert abs(pair.angle) < math.radians(5.0)
            shared = min((b - start) @ u, (end - start) @ u) - max((a - start) @ u, 0.0)
            assert pair.overlap == pytest.approx(float(shared), abs=1e-6)
