"""Circles in the matcher: compiled steps against slow, obvious twins."""

from __future__ import annotations

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures, extract_features
from lineloom_core.features._circle_kernels import RADIUS, SENSE
from lineloom_core.geometry import Pose, wrap
from lineloom_core.matching import _circle_match_kernels as fast
from lineloom_lab.simulation import World, column_corridor, round_hall, scanner_360
from numpy.typing import NDArray

from tests.core.matching import circle_match_twins as slow
from tests.core.matching import slow_twins

Floats = NDArray[np.float64]
RoundPair = tuple[ScanFeatures, ScanFeatures, Pose]
GATE, REACH, HALF = 0.25, 0.25, 10.0


def seen(world: World, a: Pose, b: Pose, seed: int) -> RoundPair:
    rng, lidar = np.random.default_rng(seed), scanner_360()
    ref, cur = (extract_features(lidar.scan(world, pose, rng)).straight() for pose in (a, b))
    return ref, cur, a.between(b)


@pytest.fixture(scope="module")
def round_pairs() -> list[RoundPair]:
    """Scans with columns: in a hall, along a corridor, and with nothing else about."""
    wide = column_corridor(6, radius=(0.2, 0.3))
    bare = column_corridor(6, radius=(0.2, 0.3), walls=False)
    return [
        seen(round_hall(2), Pose(0.5, 0.3, 0.4), Pose(-0.6, 0.2, 1.3), 1),
        seen(round_hall(5), Pose(0.1, -0.9, 2.4), Pose(0.2, 0.8, -2.9), 2),
        seen(wide, Pose(-4.0, 2.0, 0.1), Pose(-3.2, 2.1, 0.5), 3),
        seen(bare, Pose(6.0, 2.0, -0.1), Pose(5.1, 1.9, -1.5), 4),
    ]


def test_circles_that_may_be_one(round_pairs: list[RoundPair]) -> None:
    for ref, cur, _ in round_pairs:
        found = [(int(i), int(j)) for i, j in fast.circle_pairs(ref.circles, cur.circles)]
        assert found == slow.pairs_of(ref.circles, cur.circles)
        assert len(found) >= 3
        i, j = found[0]
        other = cur.circles[j].copy()
        other[SENSE] *= -1.0
        assert not fast.same_circle(ref.circles[i], other)


def test_relations_name_rotations(round_pairs: list[RoundPair]) -> None:
    """Those of centres to lines and to each other; the true one is among the likeliest."""
    for ref, cur, T in round_pairs:
        pairs = slow.pairs_of(ref.circles, cur.circles)
        right = 0
        for p in range(len(pairs)):
            turns, weights = np.empty(500), np.empty(500)
            args = (ref.lines, ref.circles, cur.lines, cur.circles)
            count = fast.related_turns(*args, np.array(pairs), p, turns, weights)
            named = slow.turns((ref.lines, cur.lines), (ref.circles, cur.circles), pairs, p)
            assert count == len(named)
            expected = np.array(named).reshape(-1, 2)
            np.testing.assert_allclose(turns[:count], expected[:, 0], atol=1e-7)
            np.testing.assert_allclose(weights[:count], expected[:, 1], atol=1e-7)
            out = np.empty((4, 2))
            found = fast.likely_turns(turns, weights, count, 4, out)
            np.testing.assert_allclose(out[:found], slow.likely(named, 4), atol=1e-6)
            right += any(abs(wrap(t - T.theta)) < 0.03 for t in out[:found, 0])
        assert right >= 3


def test_what_circles_explain(round_pairs: list[RoundPair]) -> None:
    for ref, cur, T in round_pairs:
        pairs = fast.circle_pairs(ref.circles, cur.circles)
        for pose in (T, T @ Pose(0.1, -0.08, 0.02), T @ Pose(3.0, 2.0, 1.0)):
            taken = np.empty(len(cur.circles))
            args = (ref.circles, cur.circles)
            found = fast.centres_explained(*args, pairs, pose.to_array(), REACH, taken)
            assert found == pytest.approx(slow.explained(*args, pose, REACH))
        assert slow.explained(ref.circles, cur.circles, T, REACH) > 1.0


def test_the_true_pose_is_proposed_and_leads(round_pairs: list[RoundPair]) -> None:
    """Proposals of circles come with those of lines, best explained first."""
    for ref, cur, T in round_pairs:
        by_lines = np.array([[9.0, 9.0, 2.0, 0.5, 1.0]])
        table = fast.propose_circles(
            ref.lines, ref.circles, cur.lines, cur.circles, by_lines, 4, 120, HALF, REACH
        )
        assert np.all(np.diff(table[:, 3]) <= 0.0)
        best = T.between(Pose.from_array(table[0, :3]))
        assert np.hypot(best.x, best.y) < 0.15
        assert abs(best.theta) < 0.05
        found = [row for row in table if row[4] == 1.0 and row[0] == 9.0]
        assert len(found) == 1
        for x, y, theta, value, _ in table:
            pose = Pose(x, y, theta)
            lines = list(slow_twins.compatible(ref.lines, cur.lines, theta, np.radians(6.0)))
            if (x, y) == (9.0, 9.0):
                continue
            expected = slow_twins.explained(ref.lines, cur.lines, pose, lines, REACH)
            expected += slow.explained(ref.circles, cur.circles, pose, REACH)
            assert value == pytest.approx(expected, abs=1e-6)
        assert np.all(np.abs(table[:, :2]) <= HALF)


def test_without_circles_that_may_be_one_lines_are_left_alone(
    round_pairs: list[RoundPair],
) -> None:
    ref, cur, _ = round_pairs[0]
    other = cur.circles.copy()
    other[:, RADIUS] += 5.0
    by_lines = np.array([[1.0, 2.0, 0.3, 4.0, 5.0]])
    table = fast.propose_circles(
        ref.lines, ref.circles, cur.lines, other, by_lines, 4, 120, HALF, REACH
    )
    np.testing.assert_array_equal(table, by_lines)


@pytest.mark.parametrize("off", [Pose.identity(), Pose(0.05, -0.04, 0.02)])
def test_centres_on_centres(round_pairs: list[RoundPair], off: Pose) -> None:
    for ref, cur, T in round_pairs:
        pose, H, g, M = (T @ off).to_array(), np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
        args = (ref.circles, cur.circles, pose, GATE)
        total = fast.accumulate_circles(*args, H, g)
        slow_H, slow_g, slow_M, slow_total = slow.normal_equations(*args, fast.CENTRE_FLOOR)
        assert total == pytest.approx(slow_total)
        np.testing.assert_allclose(H, slow_H, rtol=1e-5, atol=1e-4 * slow_H.max())
        np.testing.assert_allclose(g, slow_g, rtol=1e-5, atol=1e-4 * np.abs(slow_g).max() + 1e-6)
        H[:] = 0.0
        _, used = fast.accumulate_centre_noise(*args, H, M)
        assert used >= 6
        np.testing.assert_allclose(H, slow_H, rtol=1e-5, atol=1e-4 * slow_H.max())
        np.testing.assert_allclose(M, slow_M, rtol=1e-5, atol=1e-4 * slow_M.max())
