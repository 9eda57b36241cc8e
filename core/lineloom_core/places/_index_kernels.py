"""Numba kernels of the place index. Slow twin: tests/core/places/test_index.py.

A corner is a row x, y, direction of its first line and its cosine and sine, angle from the first to
the second line, kind (see `corners_of`), weight. A line is a row x1, y1, x2, y2, cosine and sine of
its direction, offset, length.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._kernels import LENGTH, OFFSET, THETA, X1, X2, Y1, Y2
from lineloom_core.kernels import kernel
from lineloom_core.matching._proposal_kernels import wrap_angle

CORNER_COLUMNS, LINE_COLUMNS = 8, 8
TURNS = 36
MOST_VOTES = 4096


@kernel
def short_lines(lines):  # type: ignore[no-untyped-def]
    """What the index needs of a place's lines, (n, 8)."""
    out = np.empty((lines.shape[0], LINE_COLUMNS))
    for i in range(lines.shape[0]):
        out[i, 0], out[i, 1] = lines[i, X1], lines[i, Y1]
        out[i, 2], out[i, 3] = lines[i, X2], lines[i, Y2]
        out[i, 4], out[i, 5] = math.cos(lines[i, THETA]), math.sin(lines[i, THETA])
        out[i, 6], out[i, 7] = lines[i, OFFSET], lines[i, LENGTH]
    return out


@kernel
def side_of(along, length, reach):  # type: ignore[no-untyped-def]
    """Where a point `along` metres from a line's start lies: 0 at its start, 1 in it, 2 at its end.

    -1 where it is farther than `reach` from the line.
    """
    if along < -reach or along > length + reach:
        return -1
    near = min(reach, 0.3 * length)
    if along < near:
        return 0
    return 2 if along > length - near else 1


@kernel
def corners_of(lines, reach, least_sine, most):  # type: ignore[no-untyped-def]
    """Corners of a place: where two of its lines meet, or would within `reach` m, heaviest first.

    Lines are ordered so that the second turns left of the first; kind = 3 * side of the first +
    side of the second (see `side_of`).
    """
    out = np.empty((lines.shape[0] * lines.shape[0], CORNER_COLUMNS))
    count = 0
    for i in range(lines.shape[0]):
        ci, si = math.cos(lines[i, THETA]), math.sin(lines[i, THETA])
        for j in range(lines.shape[0]):
            cj, sj = math.cos(lines[j, THETA]), math.sin(lines[j, THETA])
            sine = ci * sj - si * cj
            if sine < least_sine:
                continue
            dx, dy = lines[j, X1] - lines[i, X1], lines[j, Y1] - lines[i, Y1]
            along_i = (dx * sj - dy * cj) / sine
            along_j = (dx * si - dy * ci) / sine
            side_i = side_of(along_i, lines[i, LENGTH], reach)
            side_j = side_of(along_j, lines[j, LENGTH], reach)
            if side_i < 0 or side_j < 0:
                continue
            row = out[count]
            row[0], row[1] = lines[i, X1] + along_i * ci, lines[i, Y1] + along_i * si
            row[2], row[3], row[4] = lines[i, THETA], ci, si
            row[5] = wrap_angle(lines[j, THETA] - lines[i, THETA])
            row[6] = 3 * side_i + side_j
            row[7] = min(lines[i, LENGTH], lines[j, LENGTH], 2.0)
            count += 1
    order = np.argsort(-out[:count, 7], kind="mergesort")
    return out[:count][order[:most]]


@kernel
def vote(ref, cur, half, cell, grid, votes, cells, touched):  # type: ignore[no-untyped-def]
    """Let every pair of like corners vote for the pose it implies; returns votes and cells used.

    votes (m, 4): pair (two columns), weight, turn. cells (m, 3): where each went. touched: distinct
    cells of `grid` (turns, n, n).
    """
    n = grid.shape[1]
    scale = TURNS / (2.0 * math.pi)
    count = used = 0
    for a in range(ref.shape[0]):
        for b in range(cur.shape[0]):
            if ref[a, 6] != cur[b, 6] or abs(ref[a, 5] - cur[b, 5]) > 0.14:
                continue
            if count == votes.shape[0]:
                return count, used
            c = ref[a, 3] * cur[b, 3] + ref[a, 4] * cur[b, 4]
            s = ref[a, 4] * cur[b, 3] - ref[a, 3] * cur[b, 4]
            tx = ref[a, 0] - c * cur[b, 0] + s * cur[b, 1]
            ty = ref[a, 1] - s * cur[b, 0] - c * cur[b, 1]
            gx, gy = math.floor((tx + half) / cell), math.floor((ty + half) / cell)
            if gx < 0 or gy < 0 or gx >= n or gy >= n:
                continue
            phi = wrap_angle(ref[a, 2] - cur[b, 2] + 0.5 * (ref[a, 5] - cur[b, 5]))
            gt = math.floor((phi + math.pi) * scale) % TURNS
            w = min(ref[a, 7], cur[b, 7])
            votes[count, 0], votes[count, 1], votes[count, 2], votes[count, 3] = a, b, w, phi
            cells[count, 0], cells[count, 1], cells[count, 2] = gt, gx, gy
            count += 1
            if grid[gt, gx, gy] == 0.0:
                touched[used, 0], touched[used, 1], touched[used, 2] = gt, gx, gy
                used += 1
            grid[gt, gx, gy] += w
    return count, used


@kernel
def around(grid, gt, gx, gy):  # type: ignore[no-untyped-def]
    """Votes in a cell and its 26 neighbours."""
    n = grid.shape[1]
    total = 0.0
    for dt in range(-1, 2):
        t = (gt + dt) % TURNS
        for x in range(max(gx - 1, 0), min(gx + 2, n)):
            for y in range(max(gy - 1, 0), min(gy + 2, n)):
                total += grid[t, x, y]
    return total


@kernel
def pose_of_peak(ref, cur, votes, cells, count, peak, pose):  # type: ignore[no-untyped-def]
    """The mean pose of the votes in and around a cell."""
    total = turn = 0.0
    first = 0.0
    for k in range(count):
        if not beside(cells[k], peak):
            continue
        if total == 0.0:
            first = votes[k, 3]
        total += votes[k, 2]
        turn += votes[k, 2] * wrap_angle(votes[k, 3] - first)
    phi = wrap_angle(first + turn / total)
    c, s = math.cos(phi), math.sin(phi)
    tx = ty = 0.0
    for k in range(count):
        if not beside(cells[k], peak):
            continue
        a, b, w = int(votes[k, 0]), int(votes[k, 1]), votes[k, 2]
        tx += w * (ref[a, 0] - c * cur[b, 0] + s * cur[b, 1])
        ty += w * (ref[a, 1] - s * cur[b, 0] - c * cur[b, 1])
    pose[0], pose[1], pose[2] = tx / total, ty / total, phi


@kernel
def beside(cell, peak):  # type: ignore[no-untyped-def]
    """Whether a cell is the peak's or one of its neighbours."""
    turn = (cell[0] - peak[0]) % TURNS
    near = turn <= 1 or turn == TURNS - 1
    return near and abs(cell[1] - peak[1]) <= 1 and abs(cell[2] - peak[2]) <= 1


@kernel
def lying_length(ref, cur, pose, reach, cos_gate):  # type: ignore[no-untyped-def]
    """Metres of current lines that lie on reference lines, nearer counts more, each once."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for j in range(cur.shape[0]):
        ax, ay = c * cur[j, 0] - s * cur[j, 1] + pose[0], s * cur[j, 0] + c * cur[j, 1] + pose[1]
        bx, by = c * cur[j, 2] - s * cur[j, 3] + pose[0], s * cur[j, 2] + c * cur[j, 3] + pose[1]
        mx, my = 0.5 * (ax + bx), 0.5 * (ay + by)
        vx, vy = c * cur[j, 4] - s * cur[j, 5], s * cur[j, 4] + c * cur[j, 5]
        best = 0.0
        for i in range(ref.shape[0]):
            ux, uy = ref[i, 4], ref[i, 5]
            if ux * vx + uy * vy < cos_gate:
                continue
            distance = abs(ux * my - uy * mx - ref[i, 6])
            if distance > reach:
                continue
            start = ux * ref[i, 0] + uy * ref[i, 1]
            ta, tb = ux * ax + uy * ay, ux * bx + uy * by
            shared = min(max(ta, tb), start + ref[i, 7]) - max(min(ta, tb), start)
            best = max(best, shared * (1.0 - 0.5 * distance / reach))
        total += best
    return total


@kernel
def likeness(ref, ref_lines, cur, cur_lines, half, cell, peaks, reach, grid, votes, cells, touched):  # type: ignore[no-untyped-def]
    """The most length that any of the best voted poses explains [m]; clears the grid."""
    count, used = vote(ref, cur, half, cell, grid, votes, cells, touched)
    best = 0.0
    sums = np.empty(used)
    for k in range(used):
        sums[k] = around(grid, touched[k, 0], touched[k, 1], touched[k, 2])
    pose = np.empty(3)
    for _ in range(peaks):
        top, where = 0.0, -1
        for k in range(used):
            if sums[k] > top:
                top, where = sums[k], k
        if where < 0:
            break
        pose_of_peak(ref, cur, votes, cells, count, touched[where], pose)
        best = max(best, lying_length(ref_lines, cur_lines, pose, reach, 0.985))
        for k in range(used):
            if beside(touched[k], touched[where]):
                sums[k] = -1.0
    for k in range(used):
        grid[touched[k, 0], touched[k, 1], touched[k, 2]] = 0.0
    return best


@kernel
def likeness_to_all(  # type: ignore[no-untyped-def]
    corners, lines, corner_ends, line_ends, chosen, cur, cur_lines, half, cell, peaks, reach, out
):
    """`likeness` of one place to each of the `chosen` places of a packed index."""
    n = math.ceil(2.0 * half / cell)
    grid = np.zeros((TURNS, n, n))
    votes = np.empty((MOST_VOTES, 4))
    cells = np.empty((MOST_VOTES, 3), dtype=np.int64)
    touched = np.empty((MOST_VOTES, 3), dtype=np.int64)
    for q in range(chosen.shape[0]):
        k = chosen[q]
        out[q] = likeness(
            corners[corner_ends[k] : corner_ends[k + 1]], lines[line_ends[k] : line_ends[k + 1]],
            cur, cur_lines, half, cell, peaks, reach, grid, votes, cells, touched,
        )  # fmt: skip
