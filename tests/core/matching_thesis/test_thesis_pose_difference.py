"""Rotational and translational difference and the check of the aligned pairs (thesis §5.6)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.matching.thesis import ThesisConfig
from lineloom_core.matching.thesis.alignment import align
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.rotation import precision_value, rotational_difference
from lineloom_core.matching.thesis.translation import translational_difference

CONFIG = ThesisConfig()
ROOM = LineSegments.of([[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 0, 4], [0, 4, 0, 0], [1, 1, 3, 2]])
ALL = [(i, i) for i in range(5)]
POSE = Pose(1.06, 2.47, math.radians(51.0))  # Fig. 5.3


def seen_from(pose: Pose, lines: LineSegments = ROOM) -> LineSegments:
    return lines.moved(pose.inverse())


def at_angle(degrees: float, length: float) -> list[float]:
    t = math.radians(degrees)
    return [0.0, 0.0, length * math.cos(t), length * math.sin(t)]


def test_precision_value_is_the_shorter_squared() -> None:
    assert precision_value(2.0, 5.0) == pytest.approx(4.0)
    assert precision_value(5.0, 2.0) == pytest.approx(2.0 * 5.0 * (2.0 / 5.0))


def test_the_weights_are_divided_by_their_sum() -> None:
    """Algorithm 8 as printed divides by the count: 1 and 2 degrees of 3 m lines would give 13.5."""
    r = LineSegments.of([at_angle(1.0, 3.0), at_angle(2.0, 3.0)])
    c = LineSegments.of([at_angle(0.0, 3.0), at_angle(0.0, 3.0)])
    assert math.degrees(rotational_difference([(0, 0), (1, 1)], r, c)) == pytest.approx(1.5)


def test_longer_lines_count_more() -> None:
    r = LineSegments.of([at_angle(0.0, 3.0), at_angle(10.0, 1.0)])
    c = LineSegments.of([at_angle(0.0, 9.0), at_angle(0.0, 1.0)])
    both = [(0, 0), (1, 1)]
    assert math.degrees(rotational_difference(both, r, c)) == pytest.approx(1.0, abs=0.01)


def test_the_mean_is_circular() -> None:
    r = LineSegments.of([at_angle(179.0, 2.0), at_angle(-179.0, 2.0)])
    c = LineSegments.of([at_angle(0.0, 2.0), at_angle(0.0, 2.0)])
    theta = rotational_difference([(0, 0), (1, 1)], r, c)
    assert abs(math.degrees(theta)) == pytest.approx(180.0)


@pytest.mark.parametrize("pose", [POSE, Pose(-3.0, 0.5, 3.1), Pose.identity()])
def test_a_known_pose_is_found(pose: Pose) -> None:
    c = seen_from(pose)
    theta = rotational_difference(ALL, ROOM, c)
    t = translational_difference(ALL, ROOM, c, theta, CONFIG)
    assert (t.x, t.y, theta) == pytest.approx((pose.x, pose.y, pose.theta))
    assert (t.edges, t.undetermined) == (8, None)  # 10 pairs of lines, 2 of them parallel
    assert t.spread == pytest.approx(0.0, abs=1e-9)


def test_partial_views_do_not_move_the_edges() -> None:
    """The intersections of lines, not their ends, are the common edges."""
    pieces = replace(ROOM, s=ROOM.s + 0.3 * (ROOM.e - ROOM.s), e=ROOM.e - 0.1 * (ROOM.e - ROOM.s))
    t = translational_difference(ALL, ROOM, seen_from(POSE, pieces), POSE.theta, CONFIG)
    assert (t.x, t.y) == pytest.approx((POSE.x, POSE.y))


def test_flat_intersections_count_little_and_the_flattest_not_at_all() -> None:
    """Lines 20 degrees apart meet sin^2 = 0.117 as surely as walls at right angles."""
    r = LineSegments.of([at_angle(0.0, 4.0), [0.0, -2.0, 0.0, 2.0], at_angle(20.0, 4.0)])
    off = np.array([0.0, 0.1])
    c = replace(r, s=r.s.copy(), e=r.e.copy())
    c.s[2] += off
    c.e[2] += off
    pairs = [(0, 0), (1, 1), (2, 2)]
    t = translational_difference(pairs, r, c, 0.0, CONFIG)
    sines = np.sin(np.radians([90.0, 20.0, 70.0])) ** 2
    steps = np.array([[0.0, 0.0], [0.1 / math.tan(math.radians(20.0)), 0.0], [0.0, -0.1]])
    assert (t.x, t.y) == pytest.approx(tuple(sines @ steps / sines.sum()))
    flat = LineSegments.of([at_angle(0.0, 4.0), at_angle(10.0, 4.0)])
    refused = translational_difference([(0, 0), (1, 1)], flat, flat, 0.0, CONFIG)
    assert refused.undetermined is not None
    assert refused.edges == 0


def test_a_corridor_fixes_only_what_lies_across() -> None:
    corridor = LineSegments.of([[0, -1, 8, -1], [8, 1, 0, 1]]).moved(Pose(0.0, 0.0, 0.5))
    pose = Pose(2.0, 0.7, 0.9)
    t = translational_difference(
        [(0, 0), (1, 1)], corridor, seen_from(pose, corridor), pose.theta, CONFIG
    )
    assert t.undetermined == pytest.approx(0.5)
    across = np.array([-math.sin(0.5), math.cos(0.5)])
    assert across @ [t.x, t.y] == pytest.approx(across @ [pose.x, pose.y])
    assert [math.cos(0.5), math.sin(0.5)] @ np.array([t.x, t.y]) == pytest.approx(0.0, abs=1e-9)


def test_without_pairs_there_is_no_difference() -> None:
    with pytest.raises(ValueError, match="no matching line segments"):
        rotational_difference([], ROOM, ROOM)
    with pytest.raises(ValueError, match="no matching line segments"):
        translational_difference([], ROOM, ROOM, 0.0, CONFIG)


def test_a_pair_that_contradicts_the_others_is_discarded() -> None:
    """Line 4 moved aside by a metre: with it the mean is wrong, without it exact (§6.3.1)."""
    moved = replace(ROOM, s=ROOM.s.copy(), e=ROOM.e.copy())
    moved.s[4] += [0.0, 1.0]
    moved.e[4] += [0.0, 1.0]
    c = seen_from(POSE, moved)
    checked = align(ALL, ROOM, c, CONFIG)
    assert checked.discarded == ((4, 4),)
    assert checked.T_reference_current.distance(POSE) < 1e-9
    believed = align(ALL, ROOM, c, replace(CONFIG, discard=False))
    assert believed.pairs == tuple(ALL)
    assert believed.T_reference_current.distance(POSE) > 0.05
    assert believed.translation.spread > 0.1


@pytest.mark.parametrize("seed", range(4))
def test_the_answer_moves_with_either_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noisy = seen_from(POSE)
    noisy = replace(noisy, s=noisy.s + 0.01 * rng.standard_normal((5, 2)))
    T = align(ALL, ROOM, noisy, CONFIG).T_reference_current
    moved_r = align(ALL, ROOM.moved(Pose(2.0, 1.0, 1.3)), noisy, CONFIG).T_reference_current
    expected = Pose(2.0, 1.0, 1.3) @ T
    assert moved_r.to_array() == pytest.approx(expected.to_array())
    moved_c = align(ALL, ROOM, noisy.moved(Pose(0.5, -1.0, -2.0)), CONFIG).T_reference_current
    assert (moved_c @ Pose(0.5, -1.0, -2.0)).to_array() == pytest.approx(T.to_array())
    back = align(ALL, noisy, ROOM, CONFIG).T_reference_current
    assert back.to_array() == pytest.approx(T.inverse().to_array())
