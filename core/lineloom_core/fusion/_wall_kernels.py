"""Numba kernels of walls: which wall each point lies on, what its keyframes say, where it is seen.

A wall is a row of WALL_COLUMNS numbers: a point on it, its direction, from where to where it
reaches along that, how far off it its points may lie, and its strength. Its free side lies on the
left.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel

CX, CY, UX, UY, LOW, HIGH, GATE, STRENGTH = range(8)
WALL_COLUMNS = 8
ROW_WALL, ROW_FRAME, ROW_COUNT, ROW_T, ROW_D, ROW_TT, ROW_TD, ROW_DD, ROW_LOW, ROW_HIGH = range(10)
ROW_COLUMNS = 10

SLACK_M = 0.25
"""How far beyond its ends a wall takes points: it may go on further than its lines were seen."""
_MOST_NEAR = 16
_BEAMS_APART = 2
_FEW, _END_BINS = 3, 8
_LEAST_SINE = 0.08
_CHORD_COSINE = math.cos(math.radians(60.0))


@kernel
def enter(walls, ox, oy, cell, columns, rows):  # type: ignore[no-untyped-def]
    """Sort walls into square cells that their points may lie in: starts (cells + 1,), members."""
    starts = np.zeros(columns * rows + 1, dtype=np.int64)
    members = np.empty(0, dtype=np.int64)
    for turn in range(2):
        seen = np.full(columns * rows, -1, dtype=np.int64)
        for w in range(walls.shape[0]):
            reach = walls[w, GATE] + 0.25 * cell
            low, high = walls[w, LOW] - SLACK_M, walls[w, HIGH] + SLACK_M
            steps = max(math.ceil((high - low) / (0.5 * cell)), 1)
            for q in range(steps + 1):
                t = low + (high - low) * q / steps
                x, y = walls[w, CX] + t * walls[w, UX] - ox, walls[w, CY] + t * walls[w, UY] - oy
                for i in range(int((y - reach) // cell), int((y + reach) // cell) + 1):
                    for j in range(int((x - reach) // cell), int((x + reach) // cell) + 1):
                        if 0 <= i < rows and 0 <= j < columns and seen[i * columns + j] != w:
                            at = i * columns + j
                            seen[at] = w
                            if turn == 0:
                                starts[at + 1] += 1
                            else:
                                members[starts[at]] = w
                                starts[at] += 1
        if turn == 0:
            starts = np.cumsum(starts)
            members = np.empty(starts[-1], dtype=np.int64)
    starts[1:] = starts[:-1].copy()
    starts[0] = 0
    return starts, members


@kernel
def assign(  # type: ignore[no-untyped-def]
    poses, begins, points, normals, walls, starts, members, ox, oy, cell, columns, rows,
    least_cosine, every, label, along, across, tally,
):  # fmt: skip
    """Give each point the wall that it lies on best, -1 for none, and its place on that.

    A wall takes points within its gate whose laser was on its free side, and whose surface, where
    that has a direction, runs its way. tally (m, 2): points of each wall, and those of them that a
    stronger wall explains as well, whichever way their surface seemed to run.
    """
    near = np.empty(_MOST_NEAR, dtype=np.int64)
    tally[:] = 0
    for k in range(poses.shape[0]):
        px, py, c, s = poses[k, 0], poses[k, 1], math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for p in range(begins[k], begins[k + 1]):
            label[p] = -1
            x, y = (
                c * points[p, 0] - s * points[p, 1] + px,
                s * points[p, 0] + c * points[p, 1] + py,
            )
            nx = c * normals[p, 0] - s * normals[p, 1]
            ny = s * normals[p, 0] + c * normals[p, 1]
            least_height = _LEAST_SINE * math.sqrt(points[p, 0] ** 2 + points[p, 1] ** 2)
            known = nx != 0.0 or ny != 0.0
            i, j = int((y - oy) // cell), int((x - ox) // cell)
            if i < 0 or j < 0 or i >= rows or j >= columns:
                continue
            count, best, least = 0, -1, np.inf
            for q in range(starts[i * columns + j], starts[i * columns + j + 1]):
                w = members[q]
                ux, uy = walls[w, UX], walls[w, UY]
                dx, dy = x - walls[w, CX], y - walls[w, CY]
                d = dy * ux - dx * uy
                if abs(d) > walls[w, GATE]:
                    continue
                t = dx * ux + dy * uy
                if t < walls[w, LOW] - SLACK_M or t > walls[w, HIGH] + SLACK_M:
                    continue
                height = (py - walls[w, CY]) * ux - (px - walls[w, CX]) * uy
                if height < least_height:
                    continue
                if count < _MOST_NEAR:
                    near[count] = w
                    count += 1
                if known and ny * ux - nx * uy < least_cosine:
                    continue
                cost = abs(d) / walls[w, GATE]
                if cost < least:
                    best, least = w, cost
                    along[p], across[p] = t, d
            if best < 0:
                continue
            label[p] = best
            tally[best, 0] += 1
            for q in range(count):
                w = near[q]
                alike = walls[w, UX] * walls[best, UX] + walls[w, UY] * walls[best, UY]
                if walls[w, STRENGTH] > walls[best, STRENGTH] and alike > _CHORD_COSINE:
                    tally[best, 1] += 1
                    break


@kernel
def said_by_keyframe(begins, label, along, across, walls):  # type: ignore[no-untyped-def]
    """Sums of the points of one keyframe on one wall: rows (r, ROW_COLUMNS), keyframe by keyframe.

    Count, means of t (along) and d (across), central second moments, least and greatest t.
    """
    slot = np.full(walls, -1, dtype=np.int64)
    rows = np.empty((1024, ROW_COLUMNS))
    used = 0
    for k in range(begins.shape[0] - 1):
        first = used
        for p in range(begins[k], begins[k + 1]):
            w = label[p]
            if w < 0:
                continue
            if slot[w] < first:
                if used == rows.shape[0]:
                    grown = np.empty((2 * used, ROW_COLUMNS))
                    grown[:used] = rows
                    rows = grown
                rows[used] = 0.0
                rows[used, ROW_WALL], rows[used, ROW_FRAME] = w, k
                rows[used, ROW_LOW], rows[used, ROW_HIGH] = np.inf, -np.inf
                slot[w] = used
                used += 1
            row = rows[slot[w]]
            t, d = along[p], across[p]
            n = row[ROW_COUNT] + 1.0
            dt, dd = t - row[ROW_T], d - row[ROW_D]
            row[ROW_COUNT] = n
            row[ROW_T] += dt / n
            row[ROW_D] += dd / n
            row[ROW_TT] += dt * (t - row[ROW_T])
            row[ROW_TD] += dt * (d - row[ROW_D])
            row[ROW_DD] += dd * (d - row[ROW_D])
            row[ROW_LOW], row[ROW_HIGH] = min(row[ROW_LOW], t), max(row[ROW_HIGH], t)
    return rows[:used].copy()


@kernel
def cover(  # type: ignore[no-untyped-def]
    begins, beams, label, along, across, fitted, reach, low, first, size, span, out
):
    """Count in how many keyframes each stretch of `size` of each wall was seen.

    What lies between the points of neighbouring beams on one wall, no more than `span` apart, was
    seen as well. Wall w owns out[first[w] : first[w + 1]], from low[w] on. Only points count
    that are within reach[w] of the fitted line, d = fitted[w, 0] + fitted[w, 1] t.
    """
    last = np.full(out.shape[0], -1, dtype=np.int64)
    for k in range(begins.shape[0] - 1):
        before, t_before, beam_before = -1, 0.0, -9
        for p in range(begins[k], begins[k + 1]):
            w = label[p]
            if w >= 0 and abs(across[p] - fitted[w, 0] - fitted[w, 1] * along[p]) > reach[w]:
                w = -1
            if w >= 0:
                t = along[p]
                since = t
                next_beam = abs(beams[p] - beam_before) <= _BEAMS_APART
                if before == w and next_beam and abs(t - t_before) <= span:
                    since = t_before
                a = int((min(t, since) - low[w]) / size)
                b = int((max(t, since) - low[w]) / size)
                for q in range(max(a, 0), min(b, first[w + 1] - first[w] - 1) + 1):
                    if last[first[w] + q] != k:
                        last[first[w] + q] = k
                        out[first[w] + q] += 1
                t_before, beam_before = t, beams[p]
            before = w


@kernel
def runs(counts, first, twice_hole, once_hole, slack, least):  # type: ignore[no-untyped-def]
    """Runs of `least` stretches and more of each wall: rows wall, begin, end, 1 where seen once.

    First what two keyframes saw or more, with what one saw beside that (`_farther`); holes up to
    `twice_hole`, and up to `once_hole` where one saw it all the same, are closed. Then what is left
    that one saw.
    """
    found = np.empty((64, 4), dtype=np.int64)
    used = 0
    for w in range(first.shape[0] - 1):
        n = first[w + 1] - first[w]
        taken = 0
        begin, end, unseen, before = -1, -1, 0, used
        for q in range(n + 1):
            seen = counts[first[w] + q] if q < n else 0
            if q < n and seen >= 2:
                hole = q - end
                if begin < 0 or (hole > twice_hole and (unseen > 0 or hole > once_hole)):
                    if begin >= 0:
                        end = _farther(counts, first[w], end - 1, n, 1, slack) + 1
                        if end - begin >= least:
                            found, used = _append(found, used, w, begin, end, 0)
                    begin = max(
                        _farther(counts, first[w], q, n, -1, slack), end if begin >= 0 else 0
                    )
                end, unseen = q + 1, 0
            elif seen == 0:
                unseen += 1
        if begin >= 0:
            end = _farther(counts, first[w], end - 1, n, 1, slack) + 1
            if end - begin >= least:
                found, used = _append(found, used, w, begin, end, 0)
        last = used
        begin, end = -1, -1
        for q in range(n + 1):
            seen = q < n and counts[first[w] + q] >= 1
            while seen and before + taken < last and q >= found[before + taken, 2]:
                taken += 1
            inside = seen and before + taken < last and q >= found[before + taken, 1]
            if seen and not inside:
                if begin >= 0 and q - end > twice_hole:
                    if end - begin >= least:
                        found, used = _append(found, used, w, begin, end, 1)
                    begin = -1
                if begin < 0:
                    begin = q
                end = q + 1
            elif inside or q == n:
                if begin >= 0 and end - begin >= least:
                    found, used = _append(found, used, w, begin, end, 1)
                begin = -1
    return found[:used].copy()


@kernel
def _farther(counts, first, at, n, step, slack):  # type: ignore[no-untyped-def]
    """Go on from the end of what two keyframes saw, as far as one did.

    Where many saw the end, one that goes on by up to `slack` looked past a corner, or is a mixed
    pixel; one that goes on farther saw a stretch that nobody else had in view.
    """
    few = True
    for q in range(_END_BINS):
        inside = at - step * q
        few = few and not (0 <= inside < n and counts[first + inside] > _FEW)
    far = at
    while 0 <= far + step < n and counts[first + far + step] >= 1:
        far += step
    return far if few or abs(far - at) > slack else at


@kernel
def _append(found, used, w, begin, end, once):  # type: ignore[no-untyped-def]
    if used == found.shape[0]:
        grown = np.empty((2 * used, 4), dtype=np.int64)
        grown[:used] = found
        found = grown
    found[used, 0], found[used, 1], found[used, 2], found[used, 3] = w, begin, end, once
    return found, used + 1
