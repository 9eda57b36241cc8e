"""Fusing glimpses into a place."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.features import EDGE
from lineloom_core.features._kernels import LENGTH, OFFSET, THETA, VAR_OFFSET, VAR_THETA
from lineloom_core.geometry import Pose, wrap
from lineloom_core.places import Glimpse, Place
from lineloom_lab.simulation import rectangle, scanner_360, sick_lms200
from numpy.typing import NDArray

from tests.core.places.conftest import PlaceMaker, Stretch

PATH = [[1.5, 2.0], [6.5, 2.4]]


@pytest.fixture(scope="module")
def room() -> tuple[list[Glimpse], Pose]:
    """Glimpses of an empty room of 8 x 5 m, and their anchor."""
    maker = PlaceMaker(rectangle(8.0, 5.0), scanner_360(), 2)
    poses = maker.poses(PATH)
    anchor = poses[len(poses) // 2]
    return maker.glimpses(poses, anchor), anchor


def test_a_room_becomes_its_four_walls_with_their_corners(
    room: tuple[list[Glimpse], Pose],
) -> None:
    glimpses, anchor = room
    place = Place(5, 2, 7, tuple(glimpses))
    assert (place.id, place.track, place.anchor) == (5, 2, 7)
    assert len(place.lines) == 4
    assert np.all(place.ends == EDGE)
    np.testing.assert_allclose(sorted(place.lines[:, LENGTH]), [5.0, 5.0, 8.0, 8.0], atol=0.1)
    around = {(0.0, 0.0), (8.0, 0.0), (8.0, 5.0), (0.0, 5.0)}
    for side in range(2):
        corners = anchor.transform(place.edges[:, side])
        found = {min(around, key=lambda c: math.dist(c, p)) for p in corners.tolist()}
        assert found == around
        assert all(min(math.dist(c, p) for c in around) < 0.1 for p in corners.tolist())


def test_fused_lines_are_rows_as_extraction_makes_them(stretches: list[Stretch]) -> None:
    for made in (stretches[0].forth, stretches[1].back):
        place = made.place
        lines = place.lines
        assert len(lines) > 8
        along = lines[:, 2:4] - lines[:, :2]
        normal = np.column_stack([-np.sin(lines[:, THETA]), np.cos(lines[:, THETA])])
        np.testing.assert_allclose(np.hypot(*along.T), lines[:, LENGTH], atol=1e-9)
        np.testing.assert_allclose(np.arctan2(along[:, 1], along[:, 0]), lines[:, THETA])
        for p in (lines[:, :2], lines[:, 2:4]):
            np.testing.assert_allclose(np.sum(normal * p, axis=1), lines[:, OFFSET], atol=1e-9)
        assert np.all(lines[:, [VAR_THETA, VAR_OFFSET]] > 0.0)
        assert place.ends.shape == (len(lines), 2)
        assert place.edges.shape == (len(lines), 2, 2)


def distance_to_walls(
    points: NDArray[np.float64], walls: NDArray[np.float64]
) -> NDArray[np.float64]:
    a, b = walls[:, :2], walls[:, 2:]
    u = b - a
    t = np.einsum("nkj,kj->nk", points[:, None] - a, u) / np.sum(u * u, axis=1)
    nearest = a + np.clip(t, 0.0, 1.0)[..., None] * u
    found: NDArray[np.float64] = np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)
    return found


def test_lines_and_surface_lie_on_the_true_walls(room: tuple[list[Glimpse], Pose]) -> None:
    glimpses, anchor = room
    place = Place(0, 0, 0, tuple(glimpses))
    walls = rectangle(8.0, 5.0).walls
    middles = 0.5 * (place.lines[:, :2] + place.lines[:, 2:4])
    assert distance_to_walls(anchor.transform(middles), walls).max() < 0.01
    surface = distance_to_walls(anchor.transform(place.surface.points), walls)
    assert surface.max() < 0.04
    assert len(place.surface.points) > 0.9 * 26.0 / 0.1


def test_normals_and_lines_face_the_side_where_the_robot_was(
    room: tuple[list[Glimpse], Pose],
) -> None:
    glimpses, _ = room
    place = Place(0, 0, 0, tuple(glimpses))
    assert np.all(place.lines[:, OFFSET] < 0.0)  # the anchor itself is in the room
    inward = np.einsum("ij,ij->i", place.surface.normals, -place.surface.points)
    assert np.mean(inward > 0.0) > 0.95
    assert np.all(inward >= 0.0)


def test_another_anchor_is_another_frame_and_nothing_else(
    room: tuple[list[Glimpse], Pose],
) -> None:
    glimpses, _ = room
    T = Pose(3.0, -1.0, 0.8)
    place = Place(0, 0, 0, tuple(glimpses))
    moved = Place(0, 0, 0, tuple(replace(g, T_anchor_laser=T @ g.T_anchor_laser) for g in glimpses))
    expected = T.transform(place.lines[:, :4].reshape(-1, 2)).reshape(-1, 4)
    for row in moved.lines:
        k = int(np.argmin(np.abs(expected - row[:4]).sum(axis=1)))
        np.testing.assert_allclose(row[:4], expected[k], atol=1e-6)
        assert wrap(row[THETA] - place.lines[k, THETA] - T.theta) == pytest.approx(0.0, abs=1e-6)
    assert len(moved.lines) == len(place.lines)


def test_sweeps_of_different_lidars_share_a_table(room: tuple[list[Glimpse], Pose]) -> None:
    glimpses, anchor = room
    sparse = PlaceMaker(rectangle(8.0, 5.0), sick_lms200(), 2)
    more = sparse.glimpses([anchor @ Pose(0.3, 0.1, 0.2)], anchor)
    place = Place(0, 0, 0, (*glimpses[:1], *more))
    assert place.ranges.shape == (2, 1080)
    np.testing.assert_array_equal(place.ranges[0], glimpses[0].sight.features.ranges)
    np.testing.assert_array_equal(place.ranges[1, :181], more[0].sight.features.ranges)
    assert np.all(np.isnan(place.ranges[1, 181:]))
    np.testing.assert_allclose(place.angle_increments, [math.tau / 1080, math.pi / 180])
    np.testing.assert_allclose(place.angle_mins, [-math.pi, -math.pi / 2])
    np.testing.assert_allclose(place.sweep_poses[1], [0.3, 0.1, 0.2], atol=1e-12)
    assert place.poses[1].distance(Pose(0.3, 0.1, 0.2)) < 1e-12
    assert place.keyframes == (0, 0)
