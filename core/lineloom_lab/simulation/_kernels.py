"""Compiled loops of the simulator; each has a slow, obvious twin in the tests.

Walls are float64 arrays of shape (n, 4), rows x1, y1, x2, y2 [m] in the world frame. The grid of
walls is stored row by row: `starts[c]:starts[c + 1]` are the places in `members` that hold the
indices of the walls touching cell c = row * columns + column.
"""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.kernels import kernel
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# A beam that passes a wall's end by less than this share of its length still hits it: two walls
# that share a corner must not let a beam slip through on a rounding error.
_END_SLACK = 1e-9


@kernel
def _cell_span(low: float, high: float, origin: float, cell: float, count: int) -> tuple[int, int]:
    """Return the first and last index of the cells that [low, high] touches, within the grid."""
    first = math.floor((low - origin) / cell - 1e-9)
    last = math.floor((high - origin) / cell + 1e-9)
    return max(0, min(first, count - 1)), max(0, min(last, count - 1))


@kernel
def _touches_cell(
    x1: float, y1: float, x2: float, y2: float, cx: float, cy: float, half: float
) -> bool:
    """Does the line through the wall cross the square around (cx, cy)? (separating axis)"""
    nx, ny = y1 - y2, x2 - x1
    return abs(nx * (cx - x1) + ny * (cy - y1)) <= half * (abs(nx) + abs(ny)) * (1.0 + 1e-9) + 1e-12


@kernel
def grid_walls(
    walls: Floats, origin_x: float, origin_y: float, cell: float, columns: int, rows: int
) -> tuple[Ints, Ints]:
    """Sort walls into the grid's cells: returns (starts, members), see the module's docstring."""
    starts = np.zeros(columns * rows + 1, dtype=np.int64)
    members = np.empty(0, dtype=np.int64)
    fill = np.zeros(columns * rows, dtype=np.int64)
    for writing in range(2):  # first count, then write
        if writing == 1:
            for c in range(columns * rows):
                starts[c + 1] += starts[c]
            members = np.empty(starts[columns * rows], dtype=np.int64)
        for i in range(walls.shape[0]):
            x1, y1, x2, y2 = walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3]
            c0, c1 = _cell_span(min(x1, x2), max(x1, x2), origin_x, cell, columns)
            r0, r1 = _cell_span(min(y1, y2), max(y1, y2), origin_y, cell, rows)
            for r in range(r0, r1 + 1):
                cy = origin_y + (r + 0.5) * cell
                for c in range(c0, c1 + 1):
                    cx = origin_x + (c + 0.5) * cell
                    if not _touches_cell(x1, y1, x2, y2, cx, cy, 0.5 * cell):
                        continue
                    at = r * columns + c
                    if writing == 0:
                        starts[at + 1] += 1
                    else:
                        members[starts[at] + fill[at]] = i
                        fill[at] += 1
    return starts, members


@kernel
def _hit(walls: Floats, i: int, ox: float, oy: float, dx: float, dy: float) -> float:
    """Return how far along the unit beam wall i is met, or infinity."""
    ex, ey = walls[i, 2] - walls[i, 0], walls[i, 3] - walls[i, 1]
    determinant = dx * ey - dy * ex
    if abs(determinant) < 1e-14:
        return math.inf
    ax, ay = walls[i, 0] - ox, walls[i, 1] - oy
    along_wall = (ax * dy - ay * dx) / determinant
    if along_wall < -_END_SLACK or along_wall > 1.0 + _END_SLACK:
        return math.inf
    distance = (ax * ey - ay * ex) / determinant
    return distance if distance >= 0.0 else math.inf


@kernel
def _enter(
    o: float, d: float, low: float, high: float, t0: float, t1: float
) -> tuple[float, float]:
    """Cut the stretch [t0, t1] of a beam to where its coordinate o + t d lies in [low, high]."""
    if d == 0.0:
        return (t0, t1) if low <= o <= high else (1.0, 0.0)
    a, b = (low - o) / d, (high - o) / d
    return max(t0, min(a, b)), min(t1, max(a, b))


@kernel
def _stride(o: float, d: float, origin: float, cell: float, at: int) -> tuple[int, float, float]:
    """Return for one axis: the step from cell to cell, where the beam leaves cell `at`, and how far
    it is from one border to the next."""
    if d == 0.0:
        return 1, math.inf, math.inf
    ahead = at + 1 if d > 0.0 else at
    return (1 if d > 0.0 else -1), (origin + ahead * cell - o) / d, cell / abs(d)


@kernel
def _cast(
    walls: Floats,
    starts: Ints,
    members: Ints,
    origin_x: float,
    origin_y: float,
    cell: float,
    columns: int,
    rows: int,
    ox: float,
    oy: float,
    dx: float,
    dy: float,
    limit: float,
) -> tuple[float, int]:
    """Walk one beam through the grid, cell by cell; the first hit in the cell at hand ends it.

    Returns the distance and which wall was hit: infinity and -1 for none.
    """
    t, t_end = _enter(ox, dx, origin_x, origin_x + columns * cell, 0.0, limit)
    t, t_end = _enter(oy, dy, origin_y, origin_y + rows * cell, t, t_end)
    if t > t_end:
        return math.inf, -1
    c = max(0, min(columns - 1, math.floor((ox + t * dx - origin_x) / cell)))
    r = max(0, min(rows - 1, math.floor((oy + t * dy - origin_y) / cell)))
    step_c, next_x, per_x = _stride(ox, dx, origin_x, cell, c)
    step_r, next_y, per_y = _stride(oy, dy, origin_y, cell, r)
    best, wall = math.inf, -1
    while 0 <= c < columns and 0 <= r < rows and t <= t_end:
        at = r * columns + c
        for k in range(starts[at], starts[at + 1]):
            distance = _hit(walls, members[k], ox, oy, dx, dy)
            if distance < best:
                best, wall = distance, members[k]
        t = min(next_x, next_y)
        if best <= t:
            break
        if next_x < next_y:
            c += step_c
            next_x += per_x
        else:
            r += step_r
            next_y += per_y
    if best > limit:
        return math.inf, -1
    return best, wall


@kernel
def cast_beams(
    walls: Floats,
    starts: Ints,
    members: Ints,
    origin_x: float,
    origin_y: float,
    cell: float,
    columns: int,
    rows: int,
    ox: float,
    oy: float,
    directions: Floats,
    limit: float,
) -> Floats:
    """Return the distance to the first wall per direction [rad, world frame]; no wall: +inf."""
    ranges = np.empty(directions.shape[0])
    for i in range(directions.shape[0]):
        dx, dy = math.cos(directions[i]), math.sin(directions[i])
        ranges[i], _ = _cast(
            walls, starts, members, origin_x, origin_y, cell, columns, rows, ox, oy, dx, dy, limit
        )
    return ranges


@kernel
def seen_surfaces(
    walls: Floats,
    starts: Ints,
    members: Ints,
    origin_x: float,
    origin_y: float,
    cell: float,
    columns: int,
    rows: int,
    ox: float,
    oy: float,
    directions: Floats,
    limit: float,
    piece: float,
) -> Ints:
    """Return per direction the wall that ends the beam, its piece and its side; -1, 0, 0 for none.

    Shape (n, 3). A wall's pieces are `piece` [m] long and are counted from its first end; side 1
    lies left of the wall's direction, 0 right of it.
    """
    seen = np.zeros((directions.shape[0], 3), dtype=np.int64)
    for i in range(directions.shape[0]):
        dx, dy = math.cos(directions[i]), math.sin(directions[i])
        distance, wall = _cast(
            walls, starts, members, origin_x, origin_y, cell, columns, rows, ox, oy, dx, dy, limit
        )
        seen[i, 0] = wall
        if wall >= 0:
            x1, y1, x2, y2 = walls[wall, 0], walls[wall, 1], walls[wall, 2], walls[wall, 3]
            along = math.hypot(ox + distance * dx - x1, oy + distance * dy - y1)
            seen[i, 1] = int(along / piece)
            seen[i, 2] = 1 if (x2 - x1) * (oy - y1) - (y2 - y1) * (ox - x1) > 0.0 else 0
    return seen


@kernel
def _point_to_wall(walls: Floats, i: int, x: float, y: float) -> float:
    """Return the squared distance of a point to wall i."""
    ex, ey = walls[i, 2] - walls[i, 0], walls[i, 3] - walls[i, 1]
    ax, ay = x - walls[i, 0], y - walls[i, 1]
    square = ex * ex + ey * ey
    u = 0.0 if square == 0.0 else min(1.0, max(0.0, (ax * ex + ay * ey) / square))
    distance: float = (ax - u * ex) ** 2 + (ay - u * ey) ** 2
    return distance


@kernel
def _point_to_move(x: float, y: float, px: float, py: float, qx: float, qy: float) -> float:
    """Return the squared distance of a point to the straight move from p to q."""
    ex, ey = qx - px, qy - py
    square = ex * ex + ey * ey
    u = 0.0 if square == 0.0 else min(1.0, max(0.0, ((x - px) * ex + (y - py) * ey) / square))
    return (x - px - u * ex) ** 2 + (y - py - u * ey) ** 2


@kernel
def move_clearance(walls: Floats, px: float, py: float, qx: float, qy: float, cap: float) -> float:
    """Return the least distance between the straight move p to q and any wall, at most `cap`."""
    best: float = cap * cap
    low_x, high_x = min(px, qx) - cap, max(px, qx) + cap
    low_y, high_y = min(py, qy) - cap, max(py, qy) + cap
    mx, my = qx - px, qy - py
    for i in range(walls.shape[0]):
        x1, y1, x2, y2 = walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3]
        if max(x1, x2) < low_x or min(x1, x2) > high_x:
            continue
        if max(y1, y2) < low_y or min(y1, y2) > high_y:
            continue
        side_1 = mx * (y1 - py) - my * (x1 - px)
        side_2 = mx * (y2 - py) - my * (x2 - px)
        side_p = (x2 - x1) * (py - y1) - (y2 - y1) * (px - x1)
        side_q = (x2 - x1) * (qy - y1) - (y2 - y1) * (qx - x1)
        if side_1 * side_2 < 0.0 and side_p * side_q < 0.0:
            return 0.0  # they cross; every other pair is closest at one of the four ends
        best = min(best, _point_to_wall(walls, i, px, py), _point_to_wall(walls, i, qx, qy))
        best = min(best, _point_to_move(x1, y1, px, py, qx, qy))
        best = min(best, _point_to_move(x2, y2, px, py, qx, qy))
    return math.sqrt(best)


@kernel
def clearance_map(
    walls: Floats,
    origin_x: float,
    origin_y: float,
    cell: float,
    columns: int,
    rows: int,
    cap: float,
) -> Floats:
    """Return each cell centre's distance to the nearest wall, at most `cap`, shape (rows, cols)."""
    clearance = np.full((rows, columns), cap * cap)
    for i in range(walls.shape[0]):
        x1, y1, x2, y2 = walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3]
        c0, c1 = _cell_span(min(x1, x2) - cap, max(x1, x2) + cap, origin_x, cell, columns)
        r0, r1 = _cell_span(min(y1, y2) - cap, max(y1, y2) + cap, origin_y, cell, rows)
        for r in range(r0, r1 + 1):
            y = origin_y + (r + 0.5) * cell
            for c in range(c0, c1 + 1):
                x = origin_x + (c + 0.5) * cell
                clearance[r, c] = min(clearance[r, c], _point_to_wall(walls, i, x, y))
    distances: Floats = np.sqrt(clearance)
    return distances
