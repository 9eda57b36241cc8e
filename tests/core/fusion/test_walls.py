"""Walls of many keyframes: one line a face, openings, thin walls, chords, ends, names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lineloom_core.features import extract_features
from lineloom_core.fusion import FusionConfig, LineObservations
from lineloom_core.fusion.stretches import Stretches
from lineloom_core.fusion.walls import Surfaces, find_walls
from lineloom_core.geometry import Pose
from lineloom_core.matching.local_map import Cloud
from lineloom_lab.simulation import Lidar, World, scanner_360
from numpy.typing import NDArray

ROOM = np.array([[0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 0, 4], [0, 4, 0, 0]], dtype=float)
NO_POSE_ERROR = (0.0, 0.0)


def seen(
    walls: NDArray[np.float64],
    places: list[tuple[float, float]],
    *,
    pose_error: tuple[float, float] = NO_POSE_ERROR,
    lidar: Lidar | None = None,
) -> tuple[LineObservations, Surfaces]:
    """What keyframes at these places see, their poses off by normal errors [m, rad]."""
    world, lidar, rng = World(walls), lidar or scanner_360(), np.random.default_rng(7)
    poses, features = [], []
    for x, y in places:
        at = Pose(x, y, float(rng.uniform(-3, 3)))
        features.append(extract_features(lidar.scan(world, at, rng)))
        step, turn = pose_error
        off = rng.normal(0.0, 1.0, 3) * [step, step, turn]
        poses.append(Pose(at.x + off[0], at.y + off[1], at.theta + off[2]))
    lines = [
        p.transform(f.lines[:, :4].reshape(-1, 2)).reshape(-1, 4)
        for p, f in zip(poses, features, strict=True)
    ]
    counts = [len(f) for f in features]
    clouds = [Cloud.of(f) for f in features]
    n = sum(counts)
    observations = LineObservations(
        endpoints=np.vstack(lines),
        sigma=np.full(n, 0.01),
        weight=np.ones(n),
        keyframe=np.repeat(np.arange(len(places)), counts),
        robot=np.zeros(n, dtype=np.int64),
        stamp=np.zeros(n),
        id=np.arange(n),
    )
    surfaces = Surfaces(
        poses=np.array([p.to_array() for p in poses]),
        begins=np.cumsum([0, *(len(c.points) for c in clouds)]),
        points=np.vstack([c.points for c in clouds]),
        normals=np.vstack([c.normals for c in clouds]),
        beams=np.concatenate([f.beams for f in features]),
    )
    return observations, surfaces


def found(
    walls: NDArray[np.float64],
    places: list[tuple[float, float]],
    *,
    pose_error: tuple[float, float] = NO_POSE_ERROR,
) -> Stretches:
    return find_walls(*seen(walls, places, pose_error=pose_error), FusionConfig())


def firm(stretches: Stretches) -> NDArray[np.float64]:
    return stretches.endpoints[~stretches.once]


INSIDE = [(1.5 + 0.4 * i, 1.5 + 0.1 * i) for i in range(8)]


def test_a_room_is_four_lines_of_its_length() -> None:
    lines = firm(found(ROOM, INSIDE))
    assert len(lines) == 4
    lengths = np.sort(np.hypot(*(lines[:, 2:] - lines[:, :2]).T))
    np.testing.assert_allclose(lengths, [4, 4, 6, 6], atol=0.06)
    for line in lines:
        middle = 0.5 * (line[:2] + line[2:])
        assert min(abs(middle[0]), abs(middle[0] - 6), abs(middle[1]), abs(middle[1] - 4)) < 0.004


def test_poses_that_err_make_no_twins() -> None:
    """Poses off by 4 cm lay single observations up to 15 cm apart."""
    stretches = found(ROOM, INSIDE * 3, pose_error=(0.04, 0.004))
    assert len(firm(stretches)) == 4
    exact = found(ROOM, INSIDE * 3)
    assert stretches.sigma.max() > 3.0 * exact.sigma.max()


def test_an_opening_parts_a_line_and_not_the_wall() -> None:
    parted = np.vstack([ROOM[1:], [[0, 0, 2.5, 0], [3.5, 0, 6, 0], [2.5, -3, 3.5, -3]]])
    stretches = found(parted, INSIDE)
    lower = np.flatnonzero((np.abs(stretches.endpoints[:, [1, 3]]) < 0.05).all(axis=1))
    assert len(lower) == 2
    assert len(set(stretches.wall[lower].tolist())) == 1
    assert len(set(stretches.id[lower].tolist())) == 2
    ends = np.sort(stretches.endpoints[lower][:, [0, 2]].ravel())
    np.testing.assert_allclose(ends, [0, 2.5, 3.5, 6], atol=0.06)


def test_both_faces_of_a_thin_wall_stay() -> None:
    thin = np.vstack([ROOM, [[0.0, 1.9, 4.0, 1.9], [4.0, 1.9, 4.0, 2.0], [4.0, 2.0, 0.0, 2.0]]])
    places = [(1.0 + 0.5 * i, 0.9) for i in range(8)] + [(1.0 + 0.5 * i, 3.0) for i in range(8)]
    lines = firm(found(thin, places))
    faces = lines[(np.abs(lines[:, [1, 3]] - 1.95) < 0.08).all(axis=1)]
    faces = faces[np.hypot(*(faces[:, 2:] - faces[:, :2]).T) > 1.0]
    assert sorted(np.round(faces[:, 1], 1).tolist()) == [1.9, 2.0]
    assert (faces[0, 2] - faces[0, 0]) * (faces[1, 2] - faces[1, 0]) < 0.0


def test_a_step_in_a_wall_stays() -> None:
    """Ten centimetres, no overlap: two surfaces."""
    lower = np.array([[0.0, 0, 3, 0], [3, 0, 3, 0.12], [3, 0.12, 6, 0.12]])
    step = np.vstack([ROOM[1:], lower])
    lines = firm(found(step, INSIDE))
    low = lines[(lines[:, [1, 3]] < 0.2).all(axis=1)]
    low = low[np.hypot(*(low[:, 2:] - low[:, :2]).T) > 1.0]
    np.testing.assert_allclose(np.sort(low[:, 1]), [0.0, 0.12], atol=0.01)


def test_a_chord_across_a_corner_is_no_wall() -> None:
    observations, surfaces = seen(ROOM, INSIDE)
    chord = np.array([[5.5, 0.02, 5.98, 0.5]])
    n = len(observations)
    both = replace(
        observations,
        endpoints=np.vstack([observations.endpoints, chord]),
        sigma=np.append(observations.sigma, 0.01),
        weight=np.append(observations.weight, 1.0),
        keyframe=np.append(observations.keyframe, 0),
        robot=np.append(observations.robot, 0),
        stamp=np.append(observations.stamp, 0.0),
        id=np.append(observations.id, n),
    )
    np.testing.assert_array_equal(
        firm(find_walls(both, surfaces, FusionConfig())),
        firm(find_walls(observations, surfaces, FusionConfig())),
    )


def test_what_one_keyframe_saw_is_told_apart() -> None:
    stretches = found(ROOM, INSIDE[:1])
    assert len(stretches) == 4
    assert stretches.once.all()


def test_every_stretch_says_who_saw_it() -> None:
    stretches = found(ROOM, INSIDE)
    n = len(stretches)
    whole = stretches.seen_by(np.arange(n), np.zeros(n), stretches.end - stretches.begin)
    assert all(saw.tolist() == list(range(len(INSIDE))) for saw in whole)


def test_names_stay_as_walls_grow() -> None:
    few, more = found(ROOM, INSIDE[:3]), found(ROOM, INSIDE)
    assert set(few.id.tolist()) == set(more.id.tolist())
    assert -1 not in more.id.tolist()


def test_moved_keyframes_move_the_walls() -> None:
    observations, surfaces = seen(ROOM, INSIDE)
    T = Pose(3.0, -7.0, 2.1)
    moved = find_walls(
        replace(
            observations,
            endpoints=T.transform(observations.endpoints.reshape(-1, 2)).reshape(-1, 4),
        ),
        replace(
            surfaces,
            poses=np.array([(T @ Pose.from_array(p)).to_array() for p in surfaces.poses]),
        ),
        FusionConfig(),
    )
    here = find_walls(observations, surfaces, FusionConfig())
    np.testing.assert_allclose(
        moved.endpoints, T.transform(here.endpoints.reshape(-1, 2)).reshape(-1, 4), atol=0.045
    )


@pytest.mark.parametrize("length", [0.3, 7.0])
def test_what_is_asked_for_is_kept(length: float) -> None:
    observations, surfaces = seen(ROOM, INSIDE)
    kept = find_walls(observations, surfaces, FusionConfig(min_length=length))
    assert len(kept) == (4 if length < 4 else 0)


def test_nothing_seen_is_no_wall() -> None:
    observations, surfaces = seen(ROOM, INSIDE)
    none = {name: getattr(observations, name)[:0] for name in observations.__dataclass_fields__}
    assert len(find_walls(LineObservations(**none), surfaces, FusionConfig())) == 0
