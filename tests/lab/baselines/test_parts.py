"""The parts that baselines share, against exact answers and slow twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose, angle_difference
from lineloom_lab.baselines.complete_lines import complete_lines
from lineloom_lab.baselines.idc import PointScan, closest_points, matching_ranges
from lineloom_lab.baselines.overlap import overlapping_length
from lineloom_lab.baselines.rigid_motion import motion_of_points, shift_of_constraints
from numpy.typing import NDArray

from tests.lab.baselines.scenes import STANDPOINTS, scans

Array = NDArray[np.float64]
SCAN, OTHER = scans(STANDPOINTS[0], Pose(0.3, 0.1, 0.2))
FEATURES, OTHERS = extract_features(SCAN), extract_features(OTHER)


def test_motion_of_points_is_exact_without_noise() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        truth = Pose.from_array(rng.uniform(-3.0, 3.0, 3))
        source = rng.uniform(-5.0, 5.0, (7, 2))
        found = motion_of_points(source, truth.transform(source), rng.uniform(0.1, 2.0, 7))
        np.testing.assert_allclose(found.to_array(), truth.to_array(), atol=1e-9)


def test_shift_of_constraints_meets_walls_and_refuses_a_corridor() -> None:
    normals = np.array([[1.0, 0.0], [0.0, 1.0], [math.sqrt(0.5), math.sqrt(0.5)]])
    found = shift_of_constraints(normals, normals @ np.array([0.3, -0.7]), np.ones(3))
    assert found is not None
    np.testing.assert_allclose(found[0], [0.3, -0.7], atol=1e-12)
    corridor = np.array([[0.0, 1.0], [0.0, -1.0]])
    assert shift_of_constraints(corridor, np.array([0.1, -0.1]), np.ones(2)) is None


def test_overlapping_length_agrees_with_its_slow_twin() -> None:
    rng = np.random.default_rng(1)
    poses = np.column_stack(
        [rng.uniform(-1.0, 1.0, 30), rng.uniform(-1.0, 1.0, 30), rng.uniform(-0.3, 0.3, 30)]
    )
    fast = overlapping_length(FEATURES.lines, OTHERS.lines, poses, angle=0.1, distance=0.15)
    slow = [slow_overlap(FEATURES.lines, OTHERS.lines, Pose.from_array(p)) for p in poses]
    np.testing.assert_allclose(fast, slow, atol=1e-9)
    whole = overlapping_length(
        FEATURES.lines, FEATURES.lines, np.zeros((1, 3)), angle=0.1, distance=0.15
    )
    assert whole[0] == pytest.approx(FEATURES.lines[:, 6].sum())


def slow_overlap(reference: Array, current: Array, pose: Pose) -> float:
    total = 0.0
    for line in current:
        centre = pose.transform(0.5 * (line[0:2] + line[2:4]))
        best = 0.0
        for other in reference:
            along = np.array([math.cos(other[4]), math.sin(other[4])])
            arm = centre - other[0:2]
            across = along[0] * arm[1] - along[1] * arm[0]
            if abs(across) >= 0.15 or abs(angle_difference(line[4] + pose.theta, other[4])) >= 0.1:
                continue
            at = float(along @ arm)
            best = max(best, min(at + line[6] / 2, other[6]) - max(at - line[6] / 2, 0.0))
        total += best
    return total


def test_closest_points_lie_on_surfaces_and_nearer_than_any_point() -> None:
    reference = PointScan.of(FEATURES)
    moved = OTHERS.points[::9]
    found = np.linalg.norm(closest_points(reference, moved) - moved, axis=1)
    bare = np.linalg.norm(moved[:, None, :] - FEATURES.points[None, :, :], axis=2).min(axis=1)
    assert np.all(found <= bare + 1e-12)
    assert found.mean() < bare.mean()


def test_matching_ranges_undo_a_turn() -> None:
    reference = PointScan.of(FEATURES)
    turned = Pose(0.0, 0.0, math.radians(5.0)).transform(FEATURES.points[::3])
    window = math.radians(10.0)
    partners = matching_ranges(reference, turned, Pose.identity(), window, most_points=10_000)
    found = motion_of_points(turned, partners)
    # Flat stretches of equal range pull towards no turn: the rule wants its iterations.
    assert -math.radians(6.0) < found.theta < -math.radians(2.0)
    nowhere = matching_ranges(reference, np.zeros((1, 2)) + 1e-9, Pose.identity(), 1e-9)
    assert nowhere.shape == (1, 2)


def test_complete_lines_have_two_real_ends_and_move_with_the_scan() -> None:
    found = complete_lines(FEATURES)
    assert 2 <= len(found) <= len(FEATURES)
    assert set(found.lengths) <= set(FEATURES.lines[:, 6])
