"""Scans with perfect pose information, recorded in the simulator (§6.2, §6.3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.experiments.worlds import MAP_SIZE_M, two_rooms, wall_corner
from lineloom_lab.simulation import Drive, World, sick_lms200

CLOSED_PATH_M = 43.19
"""Distance travelled on the closed path (Fig. 6.2)."""
CLOSED_PATH_SCANS = 3069
SPARSE_PATH_SCANS = 23
STRAIGHT_RUN_M = 18.65
"""Distance travelled towards the corner (§6.3.2)."""
STRAIGHT_RUN_SCANS = 1480

_SPEED, _TURN_RATE = 0.5, 1.0  # m/s, rad/s: arcs of 0.5 m
_ROBOT_RADIUS_M = 0.25
_WALL_DISTANCE_M = 0.85
_STOP_BEFORE_CORNER_M = 2.0


@dataclass(frozen=True, eq=False)
class Recording:
    """Scans of one drive. poses: true T_world_laser of each. length: distance travelled [m]."""

    world: World
    scans: tuple[Scan, ...]
    poses: tuple[Pose, ...]
    length: float

    def __len__(self) -> int:
        return len(self.scans)

    @property
    def positions(self) -> NDArray[np.float64]:
        """True positions, (n, 2) [m] in the world frame."""
        return np.array([(p.x, p.y) for p in self.poses])


def closed_path(seed: int, scans: int = CLOSED_PATH_SCANS, share: float = 1.0) -> Recording:
    """Drive the closed path of 43.19 m through the 14 m x 7 m floor (Fig. 6.2).

    The scans lie evenly along it; the last is taken where the first was. share: drive only so
    much of the path, with scans as close (0..1, for quick runs).
    """
    world = two_rooms()
    drive = closed_drive(world)
    count = max(2, round(share * (scans - 1)) + 1)
    way = np.linspace(0.0, drive.length_m * (count - 1) / (scans - 1), count)
    stamps = (way / _SPEED).tolist()
    return _record(world, [drive.pose_at(t) for t in stamps], stamps, seed, float(way[-1]))


def closed_drive(world: World) -> Drive:
    """The closed path: through the passage and round both rooms, eight round corners."""
    width, height = MAP_SIZE_M
    low, left = _WALL_DISTANCE_M, _WALL_DISTANCE_M
    top, right = height - low, width - left
    saved = 8 * (2.0 - math.pi / 2) * (_SPEED / _TURN_RATE)  # what the arcs cut off
    depth = (CLOSED_PATH_M + saved - 2 * (right - left) - 2 * (top - low)) / 2
    tip = top - depth  # where it passes below the wall between the rooms
    start = (2.5, low)
    corners = [
        *(start, (right, low), (right, top), (8.0, top), (8.0, tip)),
        *((6.0, tip), (6.0, top), (left, top), (left, low), start),
    ]
    return Drive.along(corners, world, radius=_ROBOT_RADIUS_M, speed=_SPEED, turn_rate=_TURN_RATE)


def straight_run(seed: int, scans: int = STRAIGHT_RUN_SCANS) -> Recording:
    """Drive 18.65 m straight to the intersection of two walls, without turning (§6.3.2)."""
    first = -(STRAIGHT_RUN_M + _STOP_BEFORE_CORNER_M)
    way = np.linspace(first, first + STRAIGHT_RUN_M, scans)
    stamps = ((way - first) / _SPEED).tolist()
    poses = [Pose(x, 0.0, 0.0) for x in way.tolist()]
    return _record(wall_corner(), poses, stamps, seed, STRAIGHT_RUN_M)


def _record(
    world: World, poses: list[Pose], stamps: list[float], seed: int, length: float
) -> Recording:
    lidar, rng = sick_lms200(), np.random.default_rng(seed)
    scans = tuple(
        lidar.scan(world, pose, rng, stamp=stamp, seq=i)
        for i, (pose, stamp) in enumerate(zip(poses, stamps, strict=True))
    )
    return Recording(world, scans, tuple(poses), length)
