"""Laws of the dominant direction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lineloom_core.floorplan.alignment import aligning, dominant_direction
from lineloom_core.geometry import Pose
from lineloom_lab.simulation import World, world_named
from numpy.typing import NDArray

QUARTER = 0.5 * math.pi


def turned(walls: NDArray[np.float64], angle: float, seed: int = 0) -> NDArray[np.float64]:
    """The walls as a map has them: another frame, a centimetre of noise."""
    moved = Pose(4.0, -7.0, angle).transform(walls.reshape(-1, 2)).reshape(-1, 4)
    return moved + np.random.default_rng(seed).normal(0.0, 0.01, moved.shape)


@pytest.fixture(scope="module")
def office() -> World:
    return world_named("office", 1)


@pytest.mark.parametrize("degrees", [-44.0, -20.0, -3.0, 0.0, 1.0, 12.5, 44.9])
def test_the_turn_of_a_building_is_found(office: World, degrees: float) -> None:
    walls = turned(office.walls, math.radians(degrees))
    found = dominant_direction(walls)
    assert found is not None
    off = (found - math.radians(degrees) + 0.5 * QUARTER) % QUARTER - 0.5 * QUARTER
    assert abs(off) < math.radians(0.15)
    # Aligned, it is aligned.
    straight = aligning(walls).transform(walls.reshape(-1, 2)).reshape(-1, 4)
    again = dominant_direction(straight)
    assert again is not None
    assert abs(again) < 1e-4


def test_a_quarter_turn_and_reversed_lines_change_nothing(office: World) -> None:
    walls = turned(office.walls, 0.2)
    found = dominant_direction(walls)
    quarter = Pose(0.0, 0.0, QUARTER).transform(walls.reshape(-1, 2)).reshape(-1, 4)
    assert dominant_direction(quarter) == pytest.approx(found, abs=1e-6)
    assert dominant_direction(walls[:, [2, 3, 0, 1]]) == pytest.approx(found, abs=1e-6)
    assert dominant_direction(walls[::-1]) == pytest.approx(found, abs=1e-6)


def test_long_walls_outvote_many_short_ones() -> None:
    long = np.array([[0.0, 0.0, 30.0, 0.0], [0.0, 5.0, 30.0, 5.0]])
    rng = np.random.default_rng(0)
    start = rng.uniform(0.0, 20.0, (100, 2))
    short = np.hstack([start, start + 0.25 * np.array([math.cos(0.5), math.sin(0.5)])])
    assert dominant_direction(np.vstack([long, short])) == pytest.approx(0.0, abs=1e-6)


def test_round_buildings_and_nothing_have_no_direction() -> None:
    angle = np.linspace(0.0, 2.0 * math.pi, 181)
    ring = 10.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert dominant_direction(np.hstack([ring[:-1], ring[1:]])) is None
    assert aligning(np.hstack([ring[:-1], ring[1:]])) == Pose.identity()
    assert dominant_direction(np.empty((0, 4))) is None
