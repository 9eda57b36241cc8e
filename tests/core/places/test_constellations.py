"""Recognition by objects and corners: its compiled steps, and halls that show hardly any wall."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lineloom_core.geometry import Pose
from lineloom_core.places import _constellation_kernels as fast
from lineloom_core.places import recognise
from lineloom_lab.evaluation import pose_error
from lineloom_lab.simulation import Lidar, columned_hall, scanner_360, sick_lms200
from numpy.typing import NDArray

from tests.core.places import slow_constellations as slow
from tests.core.places.conftest import PlaceMaker, Stretch

# Compiled functions carry no types.
find_objects: Any = fast.find_objects
vote_constellations: Any = fast.vote_constellations
count_common: Any = fast.count_common
lay_on: Any = fast.lay_on
propose_constellations: Any = fast.propose_constellations
HALF, MOST = 16.0, 16
Floats = NDArray[np.float64]


def moved(landmarks: Floats, T: Pose) -> Floats:
    """The same landmarks from another frame, in another order."""
    rows = landmarks[::-1].copy()
    rows[:, :2] = T.transform(rows[:, :2])
    rows[:, 3:] = Pose(0.0, 0.0, T.theta).transform(rows[:, 3:])
    return rows


@pytest.fixture
def seen(stretches: list[Stretch]) -> list[Floats]:
    return [s.forth.place.landmarks for s in stretches]


def test_objects_are_the_small_clusters(stretches: list[Stretch]) -> None:
    for s in stretches[:4]:
        points = s.forth.place.surface.points
        found = {tuple(row) for row in find_objects(points, 0.45, 2.0).tolist()}
        assert found == slow.objects(points, 0.45, 2.0)


def test_votes_are_those_of_every_pair_against_every_pair(seen: list[Floats]) -> None:
    cast = 0
    for ref, cur in [
        (seen[0][:9], seen[1][:9]),
        (seen[2][:14], moved(seen[2][:14], Pose(1, 2, 3))),
    ]:
        votes = np.zeros((fast.TURNS, 32, 32), dtype=np.int32)
        vote_constellations(ref, cur, HALF, votes)
        expected = slow.votes(ref, cur, HALF)
        assert {tuple(cell): int(votes[tuple(cell)]) for cell in np.argwhere(votes)} == expected
        cast += sum(expected.values())
    assert cast > 70


def test_landmarks_in_common_are_the_nearest_alike(seen: list[Floats]) -> None:
    ref, pose = seen[0], Pose(0.3, -0.2, 0.1)
    pairs = np.empty((len(ref), 2), dtype=np.int64)
    count, objects = count_common(ref, ref, pose.to_array(), 0.5, pairs)
    expected = slow.common(ref, ref, pose, 0.5)
    assert [tuple(row) for row in pairs[:count].tolist()] == expected
    assert objects == sum(ref[k, fast.KIND] == fast.OBJECT for _, k in expected)
    assert count > 5


def test_the_same_landmarks_are_laid_on_each_other_from_anywhere(seen: list[Floats]) -> None:
    rng = np.random.default_rng(0)
    for landmarks in seen:
        T = Pose(*rng.uniform((-8.0, -8.0, -math.pi), (8.0, 8.0, math.pi)).tolist())
        found = propose_constellations(moved(landmarks, T), landmarks, HALF, MOST)
        error = pose_error(Pose.from_array(found[0, :3]), T)
        assert found[0, 4] == len(landmarks)
        assert error.translation < 1e-6
        assert error.rotation < 1e-6


def test_paired_landmarks_give_the_least_squares_pose() -> None:
    rng = np.random.default_rng(1)
    cur = np.column_stack([rng.uniform(-9, 9, (12, 2)), np.zeros((12, 3))])
    ref = moved(cur, Pose(1.0, -2.0, 2.5))[::-1].copy()
    ref[:, :2] += rng.normal(0.0, 0.1, (12, 2))
    pose, pairs = np.zeros(3), np.column_stack([np.arange(12)] * 2)
    lay_on(ref, cur, pairs, 12, pose)

    def off(x: float, y: float, theta: float) -> float:
        return float(((Pose(x, y, theta).transform(cur[:, :2]) - ref[:, :2]) ** 2).sum())

    least = off(*pose)
    for axis in np.eye(3):
        assert all(off(*(pose + sign * 1e-3 * axis)) > least for sign in (-1.0, 1.0))


@pytest.mark.parametrize(
    ("lidar", "radius"), [(scanner_360(), 0.15), (sick_lms200(), 0.25)], ids=["360", "180"]
)
def test_a_columned_hall_is_recognised_by_its_columns(lidar: Lidar, radius: float) -> None:
    """Columns so thin that none shows a line."""
    right = compared = 0
    for seed in range(4):
        world = columned_hall(seed, radius=radius)
        maker = PlaceMaker(world, lidar, seed)
        for x in (-10.0, 0.0):
            ref = maker.make([(x, -0.5), (x + 7.0, 0.0)])
            cur = maker.make([(x + 1.5, 0.5), (x + 8.0, 0.0)])
            found = recognise(ref.place, cur.place)
            compared += 1
            if found.plausible:
                assert found.T_reference_current is not None
                truth = ref.T_world_anchor.between(cur.T_world_anchor)
                error = pose_error(found.T_reference_current, truth)
                assert error.translation < 0.1
                assert error.rotation < 0.02
                assert found.checks["objects"] >= 4
                right += 1
    print(f"{right} of {compared} places of columned halls recognised")
    assert right >= 0.75 * compared


def test_other_columns_are_another_hall() -> None:
    plausible = 0
    for seed in range(6):
        here = PlaceMaker(columned_hall(seed), scanner_360(), seed)
        there = PlaceMaker(columned_hall(seed + 100), scanner_360(), seed)
        ref = here.make([(-5.0, 0.0), (2.0, 0.0)])
        cur = there.make([(-5.0, 0.0), (2.0, 0.0)])
        plausible += recognise(ref.place, cur.place).plausible
    assert plausible == 0
