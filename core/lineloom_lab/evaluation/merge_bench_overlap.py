"""Which robot pairs are due to merge: those that truly saw enough of the same.

Defined from the truth alone, before any result was looked at:

1. Every half metre of a robot's way its lidar is cast, without noise, people or other robots, at
   the building's walls within 8 m; a wall is cut into surfaces of 0.25 m, each side by itself.
   Doors that were closed for one robot and not for another count for neither.
2. A stretch is 5 m of way; it saw the union of what its positions saw.
3. A stretch of one robot is shared with another robot where some stretch of that one saw half of
   the smaller of both unions, and at least 3 m of it on telling walls (`Building.telling`).
4. A pair is due where each has at least 10 m of way in the middle of shared stretches; ground
   covered twice counts once.

Robots on different floors are never due, nor is one whose lidar hangs upside down undeclared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from numpy.typing import NDArray
from scipy import sparse

from lineloom_lab.evaluation.merge_bench_fleets import BenchFleet, BenchRobot

LEAST_SHARED_WAY_M = 10.0
_STEP_M = 0.5
_STRETCH_M = 5.0
_SIGHT_M = 8.0
_PIECE_M = 0.25
_LEAST_SHARE = 0.5
_LEAST_TELLING_M = 3.0
_MOST_PIECES = 1 << 12
_BEAMS = 180
_TIME_STEP_S = 0.2
_GROUND_M = 0.5


@dataclass(frozen=True, eq=False)
class Overlap:
    """How much of each robot's way is shared with each other robot, shape (n, n) [m].

    due: which pairs must be merged, shape (n, n), symmetric, false on the diagonal. shared: per
    (i, j) the middles of i's stretches that it shares with j, each of shape (k, 2) [m].
    """

    way_m: NDArray[np.float64]
    due: NDArray[np.bool_]
    shared: dict[tuple[int, int], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class _Stretches:
    """What a robot's stretches saw: sparse (stretches, surfaces), and where their middles are."""

    seen: sparse.csr_matrix
    middles: NDArray[np.float64]
    telling: NDArray[np.bool_]


def overlap_of(fleet: BenchFleet) -> Overlap:
    """Measure every pair of a fleet."""
    surfaces = [_stretches(robot) for robot in fleet.robots]
    n = len(fleet.robots)
    way, shared = np.zeros((n, n)), {}
    for i, a in enumerate(fleet.robots):
        for j, b in enumerate(fleet.robots):
            if i == j or a.floor != b.floor:
                continue
            middles = surfaces[i].middles[_is_shared(surfaces[i], surfaces[j])]
            shared[i, j] = middles
            way[i, j] = _GROUND_M * len(np.unique(np.floor(middles / _GROUND_M), axis=0))
    due = np.minimum(way, way.T) >= LEAST_SHARED_WAY_M
    for i, robot in enumerate(fleet.robots):
        if robot.undeclared:
            due[i, :] = due[:, i] = False
    return Overlap(way, due, shared)


def _stretches(robot: BenchRobot) -> _Stretches:
    """What each stretch of a robot's way saw of its floor (steps 1 and 2)."""
    poses = _poses_on_way(robot)
    building = robot.building
    columns = len(building.world.walls) * _MOST_PIECES * 2
    rows, surfaces = [], []
    for row, pose in enumerate(poses):
        seen = np.unique(_seen_from(robot, pose))
        rows.append(np.full(len(seen), row))
        surfaces.append(seen)
    at, found = np.concatenate(rows), np.concatenate(surfaces)
    once = sparse.csr_matrix((np.ones(len(at)), (at, found)), shape=(len(poses), columns))
    half = round(0.5 * _STRETCH_M / _STEP_M)
    window = sparse.diags(
        [np.ones(len(poses))] * (2 * half + 1), list(range(-half, half + 1)),
        shape=(len(poses), len(poses)),
    )  # fmt: skip
    union = sparse.csr_matrix((window @ once) > 0).astype(np.float64)
    middles = np.array([(p.x, p.y) for p in poses])
    return _Stretches(union, middles, building.is_telling)


def _poses_on_way(robot: BenchRobot) -> list[Pose]:
    """T_world_laser every half metre of the drive, and at each turn on the spot."""
    simulated = robot.simulated
    times = np.arange(0.0, simulated.duration_s or simulated.drive.duration_s, _TIME_STEP_S)
    poses = [simulated.drive.pose_at(float(t)) @ simulated.mount.T_base_laser for t in times]
    kept = [poses[0]]
    for pose in poses[1:]:
        if pose.distance(kept[-1]) + 0.5 * abs(kept[-1].between(pose).theta) >= _STEP_M:
            kept.append(pose)
    return kept


def _seen_from(robot: BenchRobot, pose: Pose) -> NDArray[np.int64]:
    """The surfaces that the lidar's beams end on; closed doors left out."""
    simulated = robot.simulated
    angles = simulated.lidar.angles[:: max(1, simulated.lidar.beams // _BEAMS)]
    directions = pose.theta + (-angles if simulated.mount.inverted else angles)
    limit = min(_SIGHT_M, simulated.lidar.range_max)
    seen = simulated.world.grid.surfaces(pose.x, pose.y, directions, limit, _PIECE_M)
    is_wall = (seen[:, 0] >= 0) & (seen[:, 0] < len(robot.building.world.walls))
    wall, piece, side = seen[is_wall].T
    numbers: NDArray[np.int64] = (
        2 * (wall * _MOST_PIECES + np.minimum(piece, _MOST_PIECES - 1)) + side
    )
    return numbers


def _is_shared(own: _Stretches, other: _Stretches) -> NDArray[np.bool_]:
    """Which of the own stretches some stretch of the other robot shares (step 3)."""
    walls = np.repeat(own.telling, 2 * _MOST_PIECES)
    used = np.unique(np.concatenate([own.seen.indices, other.seen.indices]))
    a, b = own.seen[:, used], other.seen[:, used]
    common = (a @ b.T).toarray()
    smaller = np.minimum.outer(np.asarray(a.sum(axis=1)).ravel(), np.asarray(b.sum(axis=1)).ravel())
    telling = sparse.diags(walls[used].astype(np.float64))
    told = _PIECE_M * (a @ telling @ b.T).toarray()
    enough = (common >= _LEAST_SHARE * smaller) & (told >= _LEAST_TELLING_M)
    found: NDArray[np.bool_] = enough.any(axis=1)
    return found
