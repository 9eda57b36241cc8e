"""Worlds in which circles decide: lines alone do not know the way along, or which way around."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.matching import LineMatcher, MatchResult
from lineloom_lab.evaluation import pose_error
from lineloom_lab.simulation import (
    Lidar,
    World,
    column_corridor,
    round_hall,
    scanner_360,
    sick_lms200,
)

MATCHER = LineMatcher()
Tally = Counter[tuple[str, bool]]
Scene = tuple[ScanFeatures, ScanFeatures, Pose]


def without_circles(f: ScanFeatures) -> ScanFeatures:
    return replace(f, circles=f.circles[:0])


def scenes(world: World, lidar: Lidar, count: int, low: Pose, high: Pose) -> list[Scene]:
    """Pairs of features at most 1.5 m and 60 degrees apart, the first between low and high."""
    rng = np.random.default_rng(17)
    found: list[Scene] = []
    while len(found) < count:
        a = Pose.from_array(rng.uniform(low.to_array(), high.to_array()))
        b = a @ Pose.from_array(rng.uniform([-1.2, -0.5, -1.0], [1.2, 0.5, 1.0]))
        if world.is_free(a.x, a.y, 0.25) and world.is_free(b.x, b.y, 0.25):
            scans = [MATCHER.prepare(lidar.scan(world, pose, rng)) for pose in (a, b)]
            found.append((scans[0], scans[1], a.between(b)))
    return found


def is_right(result: MatchResult, truth: Pose) -> bool:
    if result.best is None:
        return False
    error = pose_error(result.best, truth)
    return error.translation < 0.3 and error.rotation < math.radians(5.0)


def tallies(pairs: list[Scene]) -> tuple[Tally, Tally, list[MatchResult]]:
    """Verdicts, right or wrong, with circles and without."""
    with_them, alone, results = Tally(), Tally(), []
    for ref, cur, T in pairs:
        result = MATCHER.match_prepared(ref, cur)
        results.append(result)
        with_them[result.verdict, is_right(result, T)] += 1
        result = MATCHER.match_prepared(without_circles(ref), without_circles(cur))
        alone[result.verdict, is_right(result, T)] += 1
    return with_them, alone, results


def test_columns_tell_the_way_along_a_corridor() -> None:
    """Two parallel walls: with the columns nearly all is a match, and surely so.

    Without circles the columns' points still speak in free space, but less is known: the pose is
    less exact, and the matcher less sure.
    """
    corridor = column_corridor(3)
    low, high = Pose(-20.0, 1.7, -0.5), Pose(20.0, 2.3, 0.5)
    pairs = scenes(corridor, scanner_360(), 30, low, high)
    with_them, alone, _ = tallies(pairs)
    assert with_them["match", True] >= 28, with_them
    assert with_them["match", False] == 0
    assert alone["match", False] == 0, alone


def test_columns_tell_the_way_around_a_hall() -> None:
    """The chords of a round wall lie where the split fell: lines alone turn anyhow."""
    pairs = scenes(round_hall(2), scanner_360(), 30, Pose(-1.5, -1.5, -3.0), Pose(1.5, 1.5, 3.0))
    with_them, alone, results = tallies(pairs)
    assert with_them["match", True] >= 28, with_them
    assert with_them["match", False] == 0
    assert alone["match", True] <= 0.75 * with_them["match", True], alone
    squares = []
    for (_, _, T), r in zip(pairs, results, strict=True):
        if r.verdict == "match":
            assert r.best is not None
            assert r.covariance is not None
            turn = angle_difference(r.best.theta, T.theta)
            e = np.array([r.best.x - T.x, r.best.y - T.y, turn])
            squares.append(float(e @ np.linalg.solve(r.covariance, e)))
            assert math.hypot(e[0], e[1]) < 0.02
    assert 1.0 < np.mean(squares) < 3.6


def test_columns_alone_are_enough() -> None:
    """No line anywhere: the directions from centre to centre are the rotation."""
    pillars = column_corridor(4, walls=False, radius=(0.15, 0.35))
    low, high = Pose(-15.0, 1.7, -3.0), Pose(15.0, 2.3, 3.0)
    pairs = scenes(pillars, scanner_360(), 20, low, high)
    pairs = [s for s in pairs if min(len(s[0].circles), len(s[1].circles)) >= 3]
    assert len(pairs) >= 12
    results = [MATCHER.match_prepared(ref, cur) for ref, cur, _ in pairs]
    right = [is_right(r, T) for r, (_, _, T) in zip(results, pairs, strict=True)]
    assert sum(right) >= 0.85 * len(pairs)
    assert sum(r.verdict == "match" for r in results) >= 0.6 * len(pairs)
    assert all(ok for r, ok in zip(results, right, strict=True) if r.verdict == "match")


@pytest.mark.parametrize("lidar", [scanner_360(), sick_lms200()], ids=["full", "half"])
def test_a_round_hall_without_columns_leaves_the_rotation_open(lidar: Lidar) -> None:
    hall, rng = round_hall(columns=0), np.random.default_rng(2)
    a, b = Pose(0.8, -0.5, 0.3), Pose(-0.6, 0.4, 1.2)
    result = MATCHER.match(lidar.scan(hall, a, rng), lidar.scan(hall, b, rng))
    assert result.verdict == "ambiguous"
    assert "rotation" in result.reason
    assert result.weak_direction is None
    assert result.checks["turn_information"] < 1.0
    # Known is where the hall's middle lies, unknown which way one has turned about it.
    T, C = result.T_reference_current, result.covariance
    assert T is not None
    assert C is not None
    centre = T.transform(b.inverse().transform(np.zeros(2)))
    np.testing.assert_allclose(centre, a.inverse().transform(np.zeros(2)), atol=0.05)
    assert C[2, 2] > 0.3
    arm = centre - np.array([T.x, T.y])
    J = np.array([[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]]])
    assert np.sqrt(np.diag(J @ C @ J.T)).max() < 0.15


def test_a_lone_column_says_where_it_is_and_no_more() -> None:
    world = World(column_corridor(4, walls=False, radius=(0.3, 0.31)).walls[:32])
    x, y = world.walls[:, 0].mean(), world.walls[:, 1].mean()
    rng, lidar = np.random.default_rng(2), scanner_360()
    a, b = Pose(x - 2.0, y, 0.0), Pose(x, y - 2.0, 1.4)
    result = MATCHER.match(lidar.scan(world, a, rng), lidar.scan(world, b, rng))
    assert result.verdict in {"none", "ambiguous"}


def test_swapping_scans_with_columns_inverts_the_answer() -> None:
    pairs = scenes(round_hall(5), scanner_360(), 8, Pose(-1.0, -1.0, -3.0), Pose(1.0, 1.0, 3.0))
    for ref, cur, _ in pairs:
        there, back = MATCHER.match_prepared(ref, cur), MATCHER.match_prepared(cur, ref)
        assert there.verdict == back.verdict == "match"
        assert there.best is not None
        assert back.best is not None
        error = pose_error(there.best, back.best.inverse())
        assert error.translation < 0.01
        assert error.rotation < 0.003


def test_pairs_of_lines_keep_their_extraction_numbers() -> None:
    """Chords are left out while matching, and counted all the same."""
    corridor = column_corridor(3, radius=(0.3, 0.5))
    low, high = Pose(-20.0, 1.7, -0.5), Pose(20.0, 2.3, 0.5)
    dropped = 0
    for ref, cur, _ in scenes(corridor, scanner_360(), 6, low, high):
        result = MATCHER.match_prepared(ref, cur)
        dropped += len(ref) - len(ref.straight())
        assert result.best is not None
        for pair in result.pairs:
            a, b = result.best.transform(cur.lines[pair.current, :4].reshape(2, 2))
            start, end = ref.lines[pair.reference, :4].reshape(2, 2)
            u = (end - start) / np.linalg.norm(end - start)
            off = 0.5 * (a + b) - start
            assert pair.distance == pytest.approx(abs(u[0] * off[1] - u[1] * off[0]), abs=1e-9)
    assert dropped > 5
