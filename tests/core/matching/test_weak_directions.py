"""What nothing fixes is named: along corridors, along single walls, around what is round."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.matching import LineMatcher, MatchResult
from lineloom_core.matching._hypothesis import translation_information, turn_information
from lineloom_lab.simulation import Lidar, World, round_hall, scanner_360, sick_lms200
from numpy.typing import NDArray

MATCHER = LineMatcher()
BOTH = pytest.mark.parametrize("lidar", [sick_lms200(), scanner_360()], ids=["half", "full"])


def two_scans(world: World, lidar: Lidar, a: Pose, b: Pose, seed: int = 0) -> MatchResult:
    rng = np.random.default_rng(seed)
    return MATCHER.match(lidar.scan(world, a, rng), lidar.scan(world, b, rng))


@pytest.mark.parametrize("heading", [0.0, 0.7, -0.5])
def test_along_a_corridor(heading: float) -> None:
    """The way along is named, or the view turned by half a turn; never is it a match."""
    corridor = World(np.array([[-60.0, 0.0, 60.0, 0.0], [60.0, 2.4, -60.0, 2.4]]))
    a, b = Pose(0.0, 1.0, heading), Pose(0.7, 1.3, heading + 0.3)
    truth, about_middle = a.between(b), Pose(0.0, 2.4, math.pi)
    opposite = a.between(about_middle @ b)
    for seed in range(4):
        result = two_scans(corridor, sick_lms200(), a, b, seed)
        assert result.verdict in {"weak", "ambiguous"}
        if result.verdict == "ambiguous":  # turned by half a turn it fits almost as well
            told = [result.best, *(x.T_reference_current for x in result.alternatives)]
            turns = [T.theta for T in told if T is not None]
            assert any(abs(angle_difference(t, truth.theta)) < 0.02 for t in turns)
            assert any(abs(angle_difference(t, opposite.theta)) < 0.02 for t in turns)
            continue
        assert result.weak_direction is not None
        assert result.covariance is not None
        assert abs(math.sin(result.weak_direction + heading)) < 0.02
        d = result.weak_direction
        along = np.array([math.cos(d), math.sin(d), 0.0])
        across = np.array([-math.sin(d), math.cos(d), 0.0])
        assert math.sqrt(along @ result.covariance @ along) > 3.0
        assert math.sqrt(across @ result.covariance @ across) < 0.03
        assert math.sqrt(result.covariance[2, 2]) < 0.01


def walls_in_pieces(niche: float) -> World:
    """One long wall in three pieces that stand back from each other by `niche` m, no ends seen."""
    y = 2.0
    return World(
        np.array([[60.0, y, 1.5, y], [1.5, y + niche, -2.0, y + niche], [-2.0, y, -60.0, y]])
    )


@BOTH
def test_along_a_single_wall(lidar: Lidar) -> None:
    """Seen as one line or as several in a row, it never says how far along it one is."""
    for niche in (0.0, 0.012):
        a, b = Pose(0.0, 0.0, math.pi / 2), Pose(0.4, 0.1, math.pi / 2 + 0.2)
        result = two_scans(walls_in_pieces(niche), lidar, a, b)
        assert result.verdict != "match"
        if result.weak_direction is not None:
            assert abs(math.sin(result.weak_direction)) < 0.05


@BOTH
def test_around_what_is_round(lidar: Lidar) -> None:
    hall = round_hall(columns=0)
    result = two_scans(hall, lidar, Pose(0.8, -0.5, 0.3), Pose(-0.6, 0.4, 1.2))
    assert result.verdict == "ambiguous"
    assert "rotation" in result.reason
    assert result.checks["turn_information"] < MATCHER.config.turn_below


def triangle(information: NDArray[np.float64]) -> list[float]:
    """The upper triangle, row by row, as the matcher's tables hold it."""
    upper: list[float] = information[np.triu_indices(3)].tolist()
    return upper


def information_of(rows: list[tuple[float, float, float, float]]) -> NDArray[np.float64]:
    """Sum of J'J / var over point-to-line residuals: x, y, direction of the line, sigma."""
    H = np.zeros((3, 3))
    for x, y, direction, sigma in rows:
        n = np.array([-math.sin(direction), math.cos(direction)])
        J = np.array([n[0], n[1], n[1] * x - n[0] * y])
        H += np.outer(J, J) / sigma**2
    return H


@pytest.mark.parametrize("direction", [0.0, 0.5, 1.6, 3.0])
def test_the_weak_direction_of_parallel_walls_is_theirs(direction: float) -> None:
    c, s = math.cos(direction), math.sin(direction)
    R = np.array([[c, -s], [s, c]])
    spots = [(-2.0, 1.0), (2.0, 1.0), (-1.0, -1.0), (3.0, -1.0)]
    rows = [(*(R @ np.array(p)), direction, 0.01) for p in spots]
    least, weak = translation_information(*triangle(information_of(rows)))
    assert abs(math.sin(weak - direction)) < 1e-6
    assert least == pytest.approx(0.0, abs=1e-3)
    assert turn_information(*triangle(information_of(rows))) > 1e4
    across = [(2.0, 0.0, direction + math.pi / 2, 0.01), (-2.0, 0.5, direction + 1.2, 0.01)]
    assert translation_information(*triangle(information_of([*rows, *across])))[0] > 1e3


def test_a_circle_about_any_centre_fixes_no_rotation() -> None:
    for centre in ((0.0, 0.0), (3.0, -1.0)):
        J = np.array([[1.0, 0.0, -centre[1]], [0.0, 1.0, centre[0]]])
        H = J.T @ J / 0.005**2
        assert turn_information(*triangle(H)) < 10.0
        other = np.array([[1.0, 0.0, -4.0], [0.0, 1.0, 2.0]])
        assert turn_information(*triangle(H + other.T @ other / 0.005**2)) > 1e4
