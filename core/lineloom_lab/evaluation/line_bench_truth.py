"""What a map of lines is held against: the faces and corners that scans truly saw of a world."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_lab.simulation.lidar import Lidar
from lineloom_lab.simulation.world import World

LEAST_FACE_M = 0.3
"""Shorter faces are no lines to anybody: they count for nothing, neither right nor wrong."""

_FINE_M, _PARTS = 0.02, 5
_PIECE_M = _PARTS * _FINE_M
_LEAST_HITS, _LEAST_SCANS = 3, 2
_CLOSED_PIECES = 2
_SAME_LINE_M, _SAME_WAY = 0.01, math.cos(math.radians(0.5))
_MEETING_M = 0.1
_SHARPEST, _BLUNTEST = math.radians(25.0), math.radians(155.0)


@dataclass(frozen=True, eq=False)
class TrueFaces:
    """faces (n, 4): stretches that were seen, x1, y1, x2, y2 [m], free side on the left.

    corners (k, 4): x, y [m], and the numbers of the two faces that end there. sides (m, 4): all
    that the world has, seen or not: where a line may rightly lie.
    """

    faces: NDArray[np.float64]
    corners: NDArray[np.float64]
    sides: NDArray[np.float64]


def seen_faces(world: World, lidar: Lidar, poses: Iterable[NDArray[np.float64]]) -> TrueFaces:
    """Return what sweeps from the poses (x, y, theta of the laser) saw of the world.

    A tenth of a metre of a wall's side is seen where beams of two sweeps, three in all, ended on
    it. Holes of two tenths are closed; what goes on in one line from wall to wall is one face.
    """
    hits = defaultdict[tuple[int, int], list[NDArray[np.int64]]](list)
    for x, y, theta in poses:
        seen = world.grid.surfaces(x, y, theta + lidar.angles, lidar.range_max, _FINE_M)
        seen = seen[seen[:, 0] >= 0]
        for wall, side in np.unique(seen[:, [0, 2]], axis=0).tolist():
            mine = (seen[:, 0] == wall) & (seen[:, 2] == side)
            hits[wall, side].append(seen[mine, 1])
    stretches = [
        stretch
        for (wall, side), pieces in sorted(hits.items())
        for stretch in _stretches(world.walls[wall], side, pieces)
    ]
    faces = _joined(np.array(stretches).reshape(-1, 4))
    sides = np.vstack([world.walls, np.roll(world.walls, 2, axis=1)])
    return TrueFaces(faces, _corners(faces), sides)


def _stretches(
    wall: NDArray[np.float64], side: int, sweeps: list[NDArray[np.int64]]
) -> list[NDArray[np.float64]]:
    length = math.hypot(wall[2] - wall[0], wall[3] - wall[1])
    hits = np.unique(np.concatenate(sweeps))
    count = np.bincount(np.concatenate(sweeps) // _PARTS)
    by = np.bincount(np.concatenate([np.unique(s // _PARTS) for s in sweeps]))
    seen = np.flatnonzero((count >= _LEAST_HITS) & (by >= _LEAST_SCANS))
    runs = np.split(seen, np.flatnonzero(np.diff(seen) > _CLOSED_PIECES + 1) + 1)
    start, along = wall[:2], (wall[2:] - wall[:2]) / length
    found = []
    for run in runs:
        inside = hits[np.isin(hits // _PARTS, run)]
        if len(inside):
            a, b = inside[0] * _FINE_M, min((inside[-1] + 1) * _FINE_M, length)
            ends = (start + a * along, start + b * along)
            found.append(np.concatenate(ends if side == 1 else ends[::-1]))
    return found


def _joined(faces: NDArray[np.float64]) -> NDArray[np.float64]:
    """Join faces that go on in one line, within the holes that are closed."""
    left = [row.copy() for row in faces]
    gap = _PIECE_M * (_CLOSED_PIECES + 0.5)
    changed = True
    while changed:
        changed = False
        for i, a in enumerate(left):
            u = (a[2:] - a[:2]) / max(math.hypot(*(a[2:] - a[:2])), 1e-9)
            for j, b in enumerate(left):
                if i == j:
                    continue
                d = b - np.tile(a[:2], 2)
                v = (b[2:] - b[:2]) / max(math.hypot(*(b[2:] - b[:2])), 1e-9)
                across = np.abs([d[1] * u[0] - d[0] * u[1], d[3] * u[0] - d[2] * u[1]])
                along, end = d[0] * u[0] + d[1] * u[1], float((a[2:] - a[:2]) @ u)
                if u @ v > _SAME_WAY and across.max() < _SAME_LINE_M and abs(along - end) <= gap:
                    left[i] = np.concatenate([a[:2], b[2:]])
                    del left[j]
                    changed = True
                    break
            if changed:
                break
    long = [f for f in left if math.hypot(f[2] - f[0], f[3] - f[1]) >= LEAST_FACE_M]
    return np.array(long).reshape(-1, 4)


def _corners(faces: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the end of one face meets the start of the next, which turns there."""
    found = []
    for i, a in enumerate(faces):
        for j, b in enumerate(faces):
            if i == j or math.dist(a[2:], b[:2]) > _MEETING_M:
                continue
            u, v = a[2:] - a[:2], b[2:] - b[:2]
            sine = (u[0] * v[1] - u[1] * v[0]) / (math.hypot(*u) * math.hypot(*v))
            turn = abs(math.atan2(sine, float(u @ v) / (math.hypot(*u) * math.hypot(*v))))
            if _SHARPEST <= turn <= _BLUNTEST:
                d = b[:2] - a[:2]
                t = (d[0] * v[1] - d[1] * v[0]) / (u[0] * v[1] - u[1] * v[0])
                found.append([*(a[:2] + t * u), i, j])
    return np.array(found).reshape(-1, 4)
