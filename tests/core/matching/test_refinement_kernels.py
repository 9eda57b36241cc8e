"""Refinement and the free-space check: compiled steps against slow, obvious twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_core.matching import _free_space_kernels as free
from lineloom_core.matching import _refinement_kernels as fast
from lineloom_core.matching.free_space import TOLERANCE, TOLERANCE_SLOPE, judge_sweeps, seen_by
from lineloom_lab.simulation import rectangle, scanner_360, sick_lms200
from numpy.typing import NDArray

from tests.core.matching import slow_twins as slow

Floats = NDArray[np.float64]
FeaturePair = tuple[ScanFeatures, ScanFeatures, Pose]
NEAR = Pose(0.08, -0.06, 0.03)


def lines_of(f: ScanFeatures) -> tuple[Floats, NDArray[np.int64], Floats]:
    return f.lines, f.ends, f.edges


def sweep_of(f: ScanFeatures) -> tuple[Floats, float, float]:
    return f.ranges, f.angle_min, f.angle_increment


def test_three_equations() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        root, b = rng.normal(size=(3, 3)), rng.normal(size=3)
        A = root @ root.T + 0.1 * np.eye(3)
        np.testing.assert_allclose(fast.solve3(A, b), np.linalg.solve(A, b), atol=1e-8)
    np.testing.assert_array_equal(fast.solve3(np.zeros((3, 3)), np.ones(3)), np.zeros(3))


@pytest.mark.parametrize("gates", [(math.radians(7.0), 0.25), (math.radians(3.0), 0.12)])
def test_normal_equations_are_those_of_a_numeric_jacobian(
    feature_pairs: list[FeaturePair], gates: tuple[float, float]
) -> None:
    for ref, cur, T in feature_pairs:
        for pose in (T.to_array(), (T @ NEAR).to_array()):
            H, g = np.zeros((3, 3)), np.zeros(3)
            pairs = np.empty((len(ref) * len(cur), 2), dtype=np.int64)
            along = fast.directions(ref.lines)
            count = fast.lines_near(ref.lines, along, cur.lines, pose, gates[0], pairs)
            assert count < 0.5 * len(pairs)
            total = fast.accumulate_lines(
                ref.lines, along, ref.ends, ref.edges, *lines_of(cur),
                pairs, count, pose, *gates, H, g,
            )  # fmt: skip
            found, expected_total = slow.residuals(ref, cur, pose, *gates)
            assert len(found) > 4
            expected_H, expected_g = slow.normal_equations(found, pose)
            assert total == pytest.approx(expected_total)
            np.testing.assert_allclose(H, expected_H, rtol=1e-5, atol=1e-2)
            np.testing.assert_allclose(g, expected_g, rtol=1e-5, atol=1e-2)


@pytest.mark.parametrize("iterations", [0, 1, 2, 4])
def test_refinement_is_gauss_newton(feature_pairs: list[FeaturePair], iterations: int) -> None:
    """Also half way: where it ends up does not show how much a step was held back."""
    for ref, cur, T in feature_pairs:
        pose, H = (T @ NEAR).to_array(), np.empty((3, 3))
        expected, expected_H, expected_total = slow.refine(ref, cur, pose.copy(), iterations)
        total = fast.refine(*lines_of(ref), *lines_of(cur), pose, H, iterations)
        np.testing.assert_allclose(
            Pose.from_array(pose).between(Pose.from_array(expected)).to_array(), 0.0, atol=1e-6
        )
        np.testing.assert_allclose(H, expected_H, rtol=1e-3, atol=1.0)
        assert total == pytest.approx(expected_total, rel=1e-4)


def test_refinement_finds_the_truth(feature_pairs: list[FeaturePair]) -> None:
    for ref, cur, T in feature_pairs:
        pose, H = (T @ NEAR).to_array(), np.empty((3, 3))
        fast.refine(*lines_of(ref), *lines_of(cur), pose, H, 4)
        error = T.between(Pose.from_array(pose))
        assert math.hypot(error.x, error.y) < 0.04
        assert abs(error.theta) < 0.01


def test_a_bearing_is_an_arc_tangent_to_a_hundred_thousandth() -> None:
    angles = np.linspace(-math.pi, math.pi, 4001)
    for r in (1e-6, 1.0, 50.0):
        found = [free.bearing(r * math.sin(a), r * math.cos(a)) for a in angles]
        expected = [math.atan2(r * math.sin(a), r * math.cos(a)) for a in angles]
        np.testing.assert_allclose(found, expected, atol=1.1e-5)
    assert free.bearing(0.0, 0.0) == 0.0


@pytest.mark.parametrize("angle_min", [-math.pi, -math.pi / 2, 0.0, 3.0, -9.0, 11.0])
@pytest.mark.parametrize("increment", [math.radians(1.0), math.tau / 1080])
def test_the_beam_that_looks_at_a_point(angle_min: float, increment: float) -> None:
    per_radian = 1.0 / increment
    for k in range(int(math.tau / increment)):
        for off in (-0.45, 0.0, 0.45):
            a = angle_min + (k + off) * increment
            x, y = 3.0 * math.cos(a), 3.0 * math.sin(a)
            beam = free.beam_of(x, y, angle_min, per_radian, math.tau * per_radian)
            assert beam == slow.nearest_beam(np.array([x, y]), angle_min, increment)
            assert beam == k


def sweep_with_holes(beams: int, increment: float) -> tuple[Floats, float, float]:
    rng = np.random.default_rng(8)
    ranges = 3.0 + np.repeat(rng.choice([0.0, 0.3, 0.7, 2.0], beams // 10 + 1), 10)[:beams]
    ranges = ranges + np.cumsum(rng.normal(0.0, 0.02, beams))
    ranges[rng.random(beams) < 0.1] = np.nan
    ranges[rng.random(beams) < 0.1] = np.inf
    return ranges, -1.4, increment


@pytest.mark.parametrize(("beams", "increment"), [(181, math.radians(1.0)), (720, math.tau / 720)])
def test_points_before_on_and_behind_a_sweep(beams: int, increment: float) -> None:
    ranges, angle_min, step = sweep_with_holes(beams, increment)
    rng = np.random.default_rng(5)
    angles, r = rng.uniform(-math.pi, math.pi, 6000), rng.uniform(0.5, 7.0, 6000)
    verdicts = []
    for x, y in zip(r * np.cos(angles), r * np.sin(angles), strict=True):
        found = free.judge_point(
            x, y, ranges, angle_min, 1.0 / step, math.tau / step, TOLERANCE, TOLERANCE_SLOPE
        )
        point = np.array([x, y])
        assert found == slow.judge(point, ranges, angle_min, step, TOLERANCE, TOLERANCE_SLOPE)
        verdicts.append(int(found))
    assert min(np.bincount(verdicts, minlength=4)) > 100


def test_what_a_sweep_measured_and_saw_through(feature_pairs: list[FeaturePair]) -> None:
    for ref, cur, T in feature_pairs:
        measured, through = seen_by(ref, cur.points, T)
        verdicts = [
            slow.judge(T.transform(p), *sweep_of(ref), TOLERANCE, TOLERANCE_SLOPE)
            for p in cur.points
        ]
        off = np.count_nonzero(measured != (np.array(verdicts) == free.MATCHED))
        off += np.count_nonzero(through != (np.array(verdicts) == free.CONFLICT))
        assert off <= 2  # one point at a beam's border


def test_a_beam_without_return_is_never_free_space() -> None:
    point = (2.0, 0.0)
    for r, verdict in ((8.0, free.CONFLICT), (2.0, free.MATCHED), (1.0, free.OCCLUDED),
                       (np.inf, free.OUTSIDE), (np.nan, free.OUTSIDE),
                       (-np.inf, free.OUTSIDE)):  # fmt: skip
        ranges = np.full(181, r)
        args = (ranges, -math.pi / 2, 180 / math.pi, 360.0, 0.1, 0.01)
        assert free.judge_point(*point, *args) == verdict


def test_free_space_one_way(feature_pairs: list[FeaturePair]) -> None:
    for ref, cur, T in feature_pairs:
        for pose in (T, T @ Pose(1.0, 0.5, 0.8)):
            counts = np.zeros(4)
            args = (TOLERANCE, TOLERANCE_SLOPE)
            spacing = cur.angle_increment
            free.judge_points(
                cur.points, spacing, 3, pose.to_array(), *sweep_of(ref), *args, counts
            )
            expected = slow.judge_all(cur.points[::3], spacing, pose, sweep_of(ref), *args)
            np.testing.assert_allclose(counts, expected, atol=0.051)  # one point at a beam's border
            assert counts.sum() == pytest.approx(expected.sum())


def test_free_space_both_ways_is_the_same_from_either_side(
    feature_pairs: list[FeaturePair],
) -> None:
    for ref, cur, T in feature_pairs:
        there, back = judge_sweeps(ref, cur, T), judge_sweeps(cur, ref, T.inverse())
        assert there.matched == pytest.approx(back.matched, abs=0.06)
        assert there.conflict == pytest.approx(back.conflict, abs=0.06)
        elsewhere = judge_sweeps(ref, cur, T @ Pose(0.9, 0.7, 1.0))
        assert there.conflict_share < 0.08
        assert elsewhere.conflict_share > there.conflict_share + 0.1


def test_metres_of_wall_are_those_of_the_lidar_that_measured_them() -> None:
    """Whichever lidar the other is: a dense sweep has no more wall to show than a sparse one."""
    room, here, rng = rectangle(9.0, 6.0), Pose(4.0, 2.5, 0.3), np.random.default_rng(6)
    dense, sparse = (
        extract_features(lidar.scan(room, here, rng)) for lidar in (scanner_360(), sick_lms200())
    )
    one_way = {}
    for name, points, sweep in (("dense", dense, sparse), ("sparse", sparse, dense)):
        counts = np.zeros(4)
        free.judge_points(
            points.points, points.angle_increment, 1, np.zeros(3), *sweep_of(sweep),
            TOLERANCE, TOLERANCE_SLOPE, counts,
        )  # fmt: skip
        r = np.hypot(*points.points.T)
        share = np.minimum(r * points.angle_increment, 0.05)
        assert counts.sum() == pytest.approx(share.sum())
        one_way[name] = counts[free.MATCHED]
    both = judge_sweeps(sparse, dense, Pose.identity())
    assert both.matched == pytest.approx(one_way["dense"] + one_way["sparse"])
    assert both.conflict_share < 0.01


def test_a_check_that_could_judge_nothing_shows_no_conflict() -> None:
    room, rng = rectangle(9.0, 6.0), np.random.default_rng(7)
    a = extract_features(sick_lms200().scan(room, Pose(4.0, 3.0, 0.0), rng))
    behind = judge_sweeps(a, a, Pose(-30.0, 0.0, math.pi))
    assert behind.matched == behind.conflict == 0.0
    assert behind.conflict_share == 0.0
    assert behind.outside > 0.0


def test_a_point_is_matched_where_as_many_sweeps_measured_it_as_saw_through(
    feature_pairs: list[FeaturePair],
) -> None:
    sweeps = [(Pose.identity(), ref) for ref, _, _ in feature_pairs[:1]]
    sweeps += [(T, cur) for _, cur, T in feature_pairs[:3]]  # two of them from elsewhere
    ref, _, _ = feature_pairs[0]
    pose = Pose(0.4, 0.3, 0.2)
    counts, args = np.zeros(4), (TOLERANCE, TOLERANCE_SLOPE)
    free.judge_cloud(
        ref.points, 1, pose.to_array(), np.array([f.ranges for _, f in sweeps]),
        np.array([f.angle_min for _, f in sweeps]),
        np.array([f.angle_increment for _, f in sweeps]),
        np.array([T.to_array() for T, _ in sweeps]), *args, counts,
    )  # fmt: skip
    expected = slow.judge_cloud(ref.points, pose, [(T, sweep_of(f)) for T, f in sweeps], *args)
    np.testing.assert_allclose(counts, expected, atol=1)
    assert np.all(expected[: free.OCCLUDED] > 10)


def test_the_inverse_of_a_pose() -> None:
    pose, back = Pose(3.0, -2.0, 0.9), np.empty(3)
    free.invert_pose(pose.to_array(), back)
    np.testing.assert_allclose(back, pose.inverse().to_array(), atol=1e-12)
