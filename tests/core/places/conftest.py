"""Places as a robot would make them, its own motion known exactly."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.matching.local_map import Cloud
from lineloom_core.places import Glimpse, Place, Seen
from lineloom_lab.simulation import (
    Drive,
    FreeSpace,
    Lidar,
    Planner,
    World,
    scanner_360,
    sick_lms200,
    world_named,
)
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Made:
    """A place and the true pose of its anchor in the world."""

    place: Place
    T_world_anchor: Pose


@dataclass(frozen=True)
class Stretch:
    """One way through the world: driven twice forth, and once back."""

    forth: Made
    again: Made
    back: Made


class PlaceMaker:
    """Drives paths and makes places of what is seen; every scan has noise of its own."""

    def __init__(self, world: World, lidar: Lidar, seed: int) -> None:
        self.world, self.lidar, self.count = world, lidar, 0
        self.rng = np.random.default_rng(seed)

    def poses(self, path: ArrayLike, length: float = 5.0) -> list[Pose]:
        """A pose every 0.45 m of the path's first metres."""
        drive = Drive.along(path, self.world, radius=0.25)
        times = np.linspace(0.0, drive.duration_s, 400)
        steps = np.hypot(*np.diff(drive.positions(times), axis=0).T)
        travelled = np.concatenate([[0.0], np.cumsum(steps)])
        marks = np.arange(0.0, length, 0.45)
        return [drive.pose_at(float(t)) for t in np.interp(marks, travelled, times)]

    def glimpses(self, poses: list[Pose], anchor: Pose) -> list[Glimpse]:
        seen = [extract_features(self.lidar.scan(self.world, pose, self.rng)) for pose in poses]
        return [
            Glimpse(k, Seen(f, Cloud.of(f)), anchor.between(pose))
            for k, (f, pose) in enumerate(zip(seen, poses, strict=True))
        ]

    def make(self, path: ArrayLike, length: float = 5.0) -> Made:
        poses = self.poses(path, length)
        anchor = poses[len(poses) // 2]
        self.count += 1
        return Made(Place(self.count, 1, 0, tuple(self.glimpses(poses, anchor))), anchor)

    def stretch(self, path: ArrayLike) -> Stretch:
        backwards = np.asarray(path)[::-1]
        return Stretch(self.make(path), self.make(path), self.make(backwards))


def office_stretches(lidar: Lidar, count: int) -> list[Stretch]:
    """Stretches of 5 m from all over a furnished floor."""
    world = world_named("office", 0)
    maker, planner = PlaceMaker(world, lidar, 3), Planner(FreeSpace.of(world))
    rng, found = np.random.default_rng(0), list[Stretch]()
    while len(found) < count:
        path = planner.path(planner.space.random_point(rng), planner.space.random_point(rng))
        if 5.0 < np.hypot(*np.diff(path, axis=0).T).sum() < 9.0:
            found.append(maker.stretch(path))
    return found


@pytest.fixture(scope="session")
def half_turn_stretches() -> list[Stretch]:
    return office_stretches(sick_lms200(), 8)


@pytest.fixture(scope="session")
def full_turn_stretches() -> list[Stretch]:
    return office_stretches(scanner_360(), 4)


@pytest.fixture(params=["half", "full"])
def stretches(request: pytest.FixtureRequest) -> list[Stretch]:
    found: list[Stretch] = request.getfixturevalue(f"{request.param}_turn_stretches")
    return found


def of_one_line(place: Place) -> Place:
    """The same points, but a single line in them."""
    first, *others = place.glimpses
    glimpses = (_with_lines(first, 1), *(_with_lines(g, 0) for g in others))
    return replace(place, id=-1 - place.id, glimpses=glimpses)


def _with_lines(glimpse: Glimpse, count: int) -> Glimpse:
    f = glimpse.sight.features
    fewer = replace(f, lines=f.lines[:count], ends=f.ends[:count], edges=f.edges[:count])
    return replace(glimpse, sight=Seen(fewer, glimpse.sight.cloud))
