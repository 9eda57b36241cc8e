"""Corners are closed where walls end, and left open where somebody looks through."""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.fusion.corners import close_corners
from lineloom_core.fusion.layers import layers_of
from lineloom_core.fusion.occupancy import Rays
from lineloom_core.fusion.persistence import PersistenceConfig
from numpy.typing import NDArray

NOBODY = Rays.of([], [], [])


def closed(
    rows: list[list[float]], rays: Rays = NOBODY
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    return close_corners(np.array(rows, dtype=float).reshape(-1, 4), rays, PersistenceConfig())


def test_walls_that_nearly_meet_meet() -> None:
    lines, met = closed([[0, 0, 3.95, 0], [4, 0.08, 4, 3]])
    np.testing.assert_allclose(lines, [[0, 0, 4, 0], [4, 0, 4, 3]])
    assert met.tolist() == [[False, True], [True, False]]


def test_what_reaches_too_far_is_cut() -> None:
    lines, met = closed([[0, 0, 4.1, 0], [4, -0.12, 4, 3]])
    np.testing.assert_allclose(lines, [[0, 0, 4, 0], [4, 0, 4, 3]], atol=1e-12)
    assert met.sum() == 2


def test_two_ends_or_two_beginnings_are_no_corner() -> None:
    rows = [[0.0, 0, 3.95, 0], [4, 3, 4, 0.05]]
    lines, met = closed(rows)
    np.testing.assert_array_equal(lines, rows)
    assert not met.any()


def test_walls_of_one_line_are_no_corner() -> None:
    rows = [[0.0, 0, 2, 0], [2.1, 0, 4, 0.05]]
    assert not closed(rows)[1].any()


def test_an_end_is_in_one_corner_and_the_nearest() -> None:
    lines, met = closed([[0, 0, 3.95, 0], [4, 0.02, 4, 3], [4.1, 0.02, 4.1, 3]])
    np.testing.assert_allclose(lines[0], [0, 0, 4, 0])
    assert met[:, 0].tolist() == [False, True, False]


def test_a_gap_that_is_looked_through_stays_open() -> None:
    rows = [[0.0, 0, 3.75, 0], [4, 0.25, 4, 3]]
    assert closed(rows)[1].sum() == 2
    # From inside, straight at where the lines would cross, and far beyond.
    angles = np.arange(-0.3, 0.3, 0.01)
    towards = math.atan2(-2.0, 2.0)
    through = Rays.of(
        [np.array([2.0, 2.0, towards])] * 3, [(-0.3, 0.01)] * 3, [np.full(len(angles), 9.0)] * 3
    )
    assert not closed(rows, through)[1].any()


def test_a_short_line_is_not_cut_to_nothing() -> None:
    """Either corner alone would leave something."""
    rows = [[0.0, 0, 2.02, 0], [2, -0.1, 2, 0.12], [2.1, 0.0, 0, 0.05]]
    lines, _ = closed(rows)
    assert (np.hypot(*(lines[:, 2:] - lines[:, :2]).T) > 0.1).all()


def test_layers_go_by_what_lies_on_one_line() -> None:
    lines = np.array(
        [[0, 0, 0.6, 0], [1.6, 0, 2.2, 0], [5, 5, 5, 5.7], [7, 7, 7.3, 7], [9, 9, 9, 12]],
        dtype=float,
    )
    once = np.array([False, False, False, False, True])
    met = np.zeros((5, 2), dtype=bool)
    kinds = layers_of(lines, np.array([0, 0, 1, 2, 3]), once, met)
    assert kinds == ["wall", "wall", "furniture", "clutter", "clutter"]
    met[3, 1] = True
    assert layers_of(lines, np.array([0, 0, 1, 2, 3]), once, met)[3] == "furniture"
