"""The covariance of a match is true: errors divided by it follow chi-squared."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.matching import LineMatcher, MatchResult
from lineloom_core.matching import _covariance_kernels as fast
from lineloom_core.matching._refinement_kernels import LAST_ANGLE_GATE, LAST_DISTANCE_GATE
from lineloom_core.matching._sweep import Sweep
from lineloom_core.matching.covariance import FOUND_SIGMA, SLIDE_SIGMA, Claim, pose_covariance
from lineloom_lab.evaluation.simulated_pairs import (
    SimulatedPair,
    driven_pairs,
    simulated_pairs,
)
from lineloom_lab.simulation import Lidar, scanner_360, sick_lms200, world_named
from numpy.typing import NDArray

from tests.core.matching import covariance_twins as slow

FeaturePair = tuple[ScanFeatures, ScanFeatures, Pose]
LIDARS = {"half turn": sick_lms200(), "full turn": scanner_360()}
MATCHER = LineMatcher()


def sure_matches(world: str, lidar: Lidar, seed: int, count: int) -> list[tuple[MatchResult, Pose]]:
    """Answers that are right (but for a slide, where they are weak), and the truth."""
    rng = np.random.default_rng([seed, len(world), lidar.beams])
    return right_ones(
        simulated_pairs(world_named(world, seed), lidar, rng, count, negative_share=0.0)
    )


def right_ones(pairs: Iterable[SimulatedPair]) -> list[tuple[MatchResult, Pose]]:
    found = []
    for p in pairs:
        result, T = MATCHER.match(p.reference, p.current), p.T_reference_current
        if result.verdict not in {"match", "weak"}:
            continue
        e = kept_error(result, T)
        if np.abs(e[:-1]).max() < 0.3 and abs(e[-1]) < 0.087:
            found.append((result, T))
    return found


def projection(result: MatchResult) -> NDArray[np.float64]:
    """Rows: what the answer claims to know; all of x, y, theta, or across and theta."""
    d = result.weak_direction
    return np.eye(3) if d is None else np.array([[-math.sin(d), math.cos(d), 0.0], [0, 0, 1.0]])


def kept_error(result: MatchResult, truth: Pose) -> NDArray[np.float64]:
    T = result.T_reference_current
    assert T is not None
    e = np.array([T.x - truth.x, T.y - truth.y, angle_difference(T.theta, truth.theta)])
    kept: NDArray[np.float64] = projection(result) @ e
    return kept


def normalised(result: MatchResult, truth: Pose) -> float:
    e, B = kept_error(result, truth), projection(result)
    assert result.covariance is not None
    return float(e @ np.linalg.solve(B @ result.covariance @ B.T, e))


@pytest.fixture(scope="module")
def answers() -> dict[tuple[str, str], list[tuple[MatchResult, Pose]]]:
    return {
        (name, world): sure_matches(world, lidar, 31, 130)
        for name, lidar in LIDARS.items()
        for world in ("office", "rooms", "corridors")
    }


def test_normalised_errors_follow_chi_squared_with_three_degrees_of_freedom(
    answers: dict[tuple[str, str], list[tuple[MatchResult, Pose]]],
) -> None:
    """Mean 3; a twentieth above 7.81, a hundredth above 11.34."""
    pooled: list[float] = []
    for where, found in answers.items():
        squares = [normalised(r, T) for r, T in found if r.verdict == "match"]
        assert len(squares) > 30, where
        assert 1.7 < np.mean(squares) < 4.3, where
        pooled += squares
    everything = np.array(pooled)
    assert 2.4 < everything.mean() < 3.6
    assert 1.6 < np.median(everything) < 2.9  # of chi-squared: 2.37
    assert np.mean(everything > 7.815) < 0.08
    assert np.mean(everything > 11.345) < 0.03


def test_weak_answers_are_true_in_what_they_claim() -> None:
    """As robots meet them: on the way along corridors, often in the other direction."""
    weak: list[tuple[MatchResult, Pose]] = []
    for seed in (31, 32, 33):
        rng, world = np.random.default_rng(seed), world_named("corridors", seed)
        pairs = driven_pairs(world, sick_lms200(), rng, 200, negative_share=0.0)
        weak += [(r, T) for r, T in right_ones(pairs) if r.verdict == "weak"]
    squares = np.array([normalised(r, T) for r, T in weak])
    assert len(squares) >= 20
    assert 0.4 < np.minimum(squares, 12.0).mean() < 3.0  # of chi-squared with two: 2
    assert np.median(squares) < 2.0  # 1.39
    assert np.mean(squares > 5.99) < 0.17  # a twentieth; its tail is heavier than it should be
    for r, _ in weak:
        assert r.covariance is not None
        assert r.weak_direction is not None
        u = np.array([math.cos(r.weak_direction), math.sin(r.weak_direction), 0.0])
        assert math.sqrt(u @ r.covariance @ u) >= 0.9 * SLIDE_SIGMA


def test_a_line_is_as_noisy_as_its_own_points(feature_pairs: list[FeaturePair]) -> None:
    tried = 0
    for ref, cur, _ in feature_pairs:
        for f in (ref, cur):
            try:
                expected = slow.noise_of_lines(f)
            except AssertionError:
                continue  # behind a grille
            found = fast.line_noise(f.lines, f.points, f.beams, len(f.ranges))
            np.testing.assert_allclose(found, expected, rtol=1e-6)
            tried += 1
    assert tried >= 3


def test_noise_goes_into_the_pose_as_when_the_lines_are_moved(
    feature_pairs: list[FeaturePair],
) -> None:
    for ref, cur, T in feature_pairs[:3]:
        noise = [fast.line_noise(f.lines, f.points, f.beams, len(f.ranges)) for f in (ref, cur)]
        pose, gates = T.to_array(), (LAST_ANGLE_GATE, LAST_DISTANCE_GATE)
        H, M = np.zeros((3, 3)), np.zeros((3, 3))
        _, used = fast.accumulate_noise(
            ref.lines, ref.ends, ref.edges, noise[0], ref.angle_increment,
            cur.lines, cur.ends, cur.edges, noise[1], cur.angle_increment,
            pose, *gates, H, M,
        )  # fmt: skip
        assert used > 8
        slow_H, slow_M = slow.accumulate(ref, noise[0], cur, noise[1], pose, gates)
        np.testing.assert_allclose(H, slow_H, rtol=1e-5, atol=1e-3 * np.abs(slow_H).max())
        np.testing.assert_allclose(M, slow_M, rtol=2e-3, atol=2e-3 * np.abs(slow_M).max())


def test_nothing_in_common_is_nothing_known(feature_pairs: list[FeaturePair]) -> None:
    ref, cur, T = feature_pairs[0]
    C = pose_covariance(Sweep.of(ref), Sweep.of(cur), T @ Pose(60.0, 60.0, 0.0))
    np.testing.assert_allclose(C, np.diag([100.0, 100.0, 1.0]))


@pytest.mark.parametrize("turn", [0.8, -2.0])
def test_the_covariance_turns_with_the_reference(
    feature_pairs: list[FeaturePair], turn: float
) -> None:
    ref, cur, T = feature_pairs[0]
    R = Pose(0.0, 0.0, turn)
    C = pose_covariance(Sweep.of(ref), Sweep.of(cur), T)
    lines, edges = ref.lines.copy(), ref.edges.copy()
    lines[:, :4] = R.transform(lines[:, :4].reshape(-1, 2)).reshape(-1, 4)
    lines[:, 4] += turn
    edges = R.transform(edges.reshape(-1, 2)).reshape(-1, 2, 2)
    turned = replace(
        ref,
        lines=lines,
        edges=edges,
        points=R.transform(ref.points),
        angle_min=ref.angle_min + turn,
    )
    c, s = math.cos(turn), math.sin(turn)
    J = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    found = pose_covariance(Sweep.of(turned), Sweep.of(cur), R @ T)
    np.testing.assert_allclose(found, J @ C @ J.T, rtol=1e-6)


def test_small_matrices() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        root, B = rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
        A, S, out = root @ root.T + 0.1 * np.eye(3), B @ B.T, np.empty((3, 3))
        fast.invert3(A, out)
        np.testing.assert_allclose(out, np.linalg.inv(A), atol=1e-8)
        fast.congruence(A, S, out)
        np.testing.assert_allclose(out, A @ S @ A, atol=1e-8)


@pytest.mark.parametrize("axis", [0.0, 0.9, 2.5])
@pytest.mark.parametrize("claim", ["found", "weak"])
def test_what_is_claimed_along_an_axis(
    feature_pairs: list[FeaturePair], axis: float, claim: Claim
) -> None:
    """Along it the claim, and a tilt of the axis by half the rotation's noise; else as before."""
    ref, cur, _ = feature_pairs[0]
    nowhere = Pose(60.0, 60.0, 0.0)
    before = pose_covariance(Sweep.of(ref), Sweep.of(cur), nowhere)
    after = pose_covariance(Sweep.of(ref), Sweep.of(cur), nowhere, axis, claim)
    sigma = FOUND_SIGMA if claim == "found" else SLIDE_SIGMA
    u = np.array([math.cos(axis), math.sin(axis), 0.0])
    n = np.array([-math.sin(axis), math.cos(axis), 0.0])
    assert u @ after @ u == pytest.approx(sigma**2)
    tilt = sigma**2 * 0.5 * before[2, 2]
    assert n @ after @ n == pytest.approx(n @ before @ n + tilt)
    assert after[2, 2] == pytest.approx(before[2, 2])
    assert u @ after @ n == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(after, after.T)


def test_lines_that_know_more_than_the_claim_are_believed(
    feature_pairs: list[FeaturePair],
) -> None:
    ref, cur, T = feature_pairs[0]
    r, c = Sweep.of(ref), Sweep.of(cur)
    np.testing.assert_array_equal(pose_covariance(r, c, T, 0.3, "found"), pose_covariance(r, c, T))
