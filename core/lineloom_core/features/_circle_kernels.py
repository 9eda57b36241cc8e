"""Numba kernels of circles and arcs. Slow twins: tests/core/features/circle_twins.py.

A circle is a row of CIRCLE_COLUMNS numbers (see `ScanFeatures.circles`).
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._kernels import (
    FIRST,
    LAST,
    LENGTH,
    THETA,
    X1,
    X2,
    Y1,
    Y2,
    farthest_from_chord,
    fit_run,
    prefix_moments,
)
from lineloom_core.kernels import kernel

CX, CY, RADIUS, VAR_XX, VAR_XY, VAR_YY, VAR_RADIUS, SENSE, ARC, POINTS, BEGIN, END = range(12)
CIRCLE_COLUMNS = 12
COLUMN, ROOM = 1.0, -1.0
ITERATIONS = 8
LEAST_ROOM = 1.0
LEAST_SAGITTA = 0.04
WIDEST_COLUMN = 1.4
LONGEST_CHORD = 2.5
LEAST_TURN, MOST_TURN = math.radians(1.5), math.radians(55.0)
LEAST_COLUMN_ARC, LEAST_ROOM_ARC = math.radians(60.0), math.radians(40.0)
LEAST_SEED_ARC = math.radians(12.0)
CLOSE = math.radians(6.0)
ADOPTIONS = 3
PRIOR_COUNT = 4.0
"""Points of the configured noise that count beside a circle's own."""
MOST_SPREAD = 1.4
"""How many times the lidar's noise the points may spread about a circle."""
LEAST_LIKELIHOOD = 6.0
"""How much likelier (logarithm) a circle must make the points than two lines do."""


@kernel
def invert3(A, out):  # type: ignore[no-untyped-def]
    """out = A^-1 of a symmetric 3x3 matrix; False where it is singular."""
    c00 = A[1, 1] * A[2, 2] - A[1, 2] * A[1, 2]
    c01 = A[0, 2] * A[1, 2] - A[0, 1] * A[2, 2]
    c02 = A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1]
    det = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    if det < 1e-12:
        return False
    out[0, 0], out[0, 1], out[0, 2] = c00 / det, c01 / det, c02 / det
    out[1, 1] = (A[0, 0] * A[2, 2] - A[0, 2] * A[0, 2]) / det
    out[1, 2] = (A[0, 1] * A[0, 2] - A[0, 0] * A[1, 2]) / det
    out[2, 2] = (A[0, 0] * A[1, 1] - A[0, 1] * A[0, 1]) / det
    out[1, 0], out[2, 0], out[2, 1] = out[0, 1], out[0, 2], out[1, 2]
    return True


@kernel
def algebraic_circle(xy, index, n):  # type: ignore[no-untyped-def]
    """Centre and radius that minimise sum (d^2 - r^2)^2 over points index[:n]; r = 0 if straight.

    And that least sum over 4 r^2, which is near the sum of the squared distances to the circle.
    """
    mx = my = 0.0
    for q in range(n):
        mx += xy[index[q], 0]
        my += xy[index[q], 1]
    mx /= n
    my /= n
    suu = suv = svv = pu = pv = zz = 0.0
    for q in range(n):
        u, v = xy[index[q], 0] - mx, xy[index[q], 1] - my
        z = u * u + v * v
        suu += u * u
        suv += u * v
        svv += v * v
        pu += u * z
        pv += v * z
        zz += z * z
    det = suu * svv - suv * suv
    if det < 1e-9 * (suu + svv) ** 2:
        return 0.0, 0.0, 0.0, 0.0
    a = 0.5 * (pu * svv - pv * suv) / det
    b = 0.5 * (pv * suu - pu * suv) / det
    mean = (suu + svv) / n
    square = a * a + b * b + mean
    least = zz - n * mean * mean - 2.0 * (a * pu + b * pv)
    return mx + a, my + b, math.sqrt(square), max(least, 0.0) / (4.0 * square)


@kernel
def geometric_circle(xy, index, n, most, circle, A, C):  # type: ignore[no-untyped-def]
    """Gauss-Newton on the distances to the circle from the algebraic fit; fills circle (3,), C.

    Returns the sum of squared distances, or -1 where there is no circle, or where the algebraic
    fit leaves more than `most` of them. C (3, 3): (J'J)^-1.
    """
    circle[0], circle[1], circle[2], squares = algebraic_circle(xy, index, n)
    if circle[2] <= 0.0 or circle[2] > 100.0 or squares > most:
        return -1.0
    for it in range(ITERATIONS + 1):
        A[:] = 0.0
        ga = gb = gr = squares = 0.0
        for q in range(n):
            dx, dy = xy[index[q], 0] - circle[0], xy[index[q], 1] - circle[1]
            d = max(math.sqrt(dx * dx + dy * dy), 1e-9)
            ux, uy, e = dx / d, dy / d, d - circle[2]
            squares += e * e
            A[0, 0] += ux * ux
            A[0, 1] += ux * uy
            A[0, 2] += ux
            A[1, 1] += uy * uy
            A[1, 2] += uy
            ga += ux * e
            gb += uy * e
            gr += e
        A[2, 2] = n
        if not invert3(A, C):
            return -1.0
        if it == ITERATIONS:
            break
        da = C[0, 0] * ga + C[0, 1] * gb + C[0, 2] * gr
        db = C[1, 0] * ga + C[1, 1] * gb + C[1, 2] * gr
        dr = C[2, 0] * ga + C[2, 1] * gb + C[2, 2] * gr
        circle[0] += da
        circle[1] += db
        circle[2] += dr
        if circle[2] <= 0.0 or circle[2] > 100.0:
            return -1.0
        if abs(da) + abs(db) + abs(dr) < 1e-7:
            break
    return squares


@kernel
def arc_extent(xy, index, n, circle):  # type: ignore[no-untyped-def]
    """Angles [rad] about the centre: what the points span, and what of it they cover closely.

    The span is a full turn less the widest gap, the cover is the sum of the gaps below CLOSE.
    """
    angles = np.empty(n)
    for q in range(n):
        angles[q] = math.atan2(xy[index[q], 1] - circle[1], xy[index[q], 0] - circle[0])
    angles.sort()
    widest = angles[0] + 2.0 * math.pi - angles[n - 1]
    cover = 0.0
    for q in range(1, n):
        gap = angles[q] - angles[q - 1]
        widest = max(widest, gap)
        if gap < CLOSE:
            cover += gap
    return 2.0 * math.pi - widest, cover


@kernel
def two_line_squares(xy, index, n):  # type: ignore[no-untyped-def]
    """Least sum of squared distances to two lines, the points split in order: a corner."""
    ordered = np.empty((n, 2))
    for q in range(n):
        ordered[q] = xy[index[q]]
    s = prefix_moments(ordered)
    best = np.inf
    for cut in range(2, n - 3):
        total = fit_run(ordered, s, 0, cut)[4] + fit_run(ordered, s, cut + 1, n - 1)[4]
        best = min(best, total)
    return best


@kernel
def sense_of(xy, index, n, circle):  # type: ignore[no-untyped-def]
    """COLUMN where nearly all points show their outside to the sensor, ROOM: inside; else 0."""
    outside = 0
    for q in range(n):
        x, y = xy[index[q], 0], xy[index[q], 1]
        if (x - circle[0]) * x + (y - circle[1]) * y < 0.0:
            outside += 1
    if outside >= 0.9 * n:
        return COLUMN
    return ROOM if outside <= 0.1 * n else 0.0


@kernel
def measured_covariance(xy, index, n, sigma, circle, squares, C):  # type: ignore[no-untyped-def]
    """Turn C = (J'J)^-1 into the covariance of centre and radius: C (J'SJ) C.

    Noise lies along the beams: where one grazes the circle little of it is across (S: its variance
    times the squared cosine of incidence). The variance is measured, PRIOR_COUNT points of sigma
    beside it.
    """
    B = np.zeros((3, 3))
    total = 0.0
    for q in range(n):
        x, y = xy[index[q], 0], xy[index[q], 1]
        dx, dy = x - circle[0], y - circle[1]
        d = max(math.sqrt(dx * dx + dy * dy), 1e-9)
        ux, uy = dx / d, dy / d
        cosine = (ux * x + uy * y) / max(math.sqrt(x * x + y * y), 1e-9)
        w = max(cosine * cosine, 0.04)
        total += w
        B[0, 0] += w * ux * ux
        B[0, 1] += w * ux * uy
        B[0, 2] += w * ux
        B[1, 1] += w * uy * uy
        B[1, 2] += w * uy
        B[2, 2] += w
    B[1, 0], B[2, 0], B[2, 1] = B[0, 1], B[0, 2], B[1, 2]
    free = total * (n - 3.0) / n
    var = (squares + PRIOR_COUNT * sigma * sigma) / (free + PRIOR_COUNT)
    C[:] = var * (C @ B @ C)


@kernel
def judge_circle(xy, index, n, sigma, circle, squares, C, row, strict):  # type: ignore[no-untyped-def]
    """Fill `row` if the points are a circle's: round enough, long enough, and no corner.

    Not `strict`: only as much as a piece of a wall must show for more of it to be looked for.
    """
    r = circle[2]
    if squares > (n - 3) * (MOST_SPREAD * sigma) ** 2:
        return False
    sense = sense_of(xy, index, n, circle)
    if sense == 0.0 or r < 0.06 or (sense == ROOM and r < LEAST_ROOM):
        return False
    measured_covariance(xy, index, n, sigma, circle, squares, C)
    if C[2, 2] > ((0.12 if strict else 0.3) * r) ** 2:
        return False
    arc, cover = arc_extent(xy, index, n, circle)
    if sense == ROOM and strict and (cover < 0.5 * arc or cover < LEAST_ROOM_ARC):
        return False
    least_arc = LEAST_COLUMN_ARC if sense == COLUMN else LEAST_ROOM_ARC
    if arc < (least_arc if strict else LEAST_SEED_ARC):
        return False
    worst = 0.0
    for q in range(n):
        dx, dy = xy[index[q], 0] - circle[0], xy[index[q], 1] - circle[1]
        worst = max(worst, abs(math.sqrt(dx * dx + dy * dy) - r))
    if worst > 4.0 * sigma:
        return False
    if strict:
        least = n * (0.2 * sigma) ** 2
        corner = two_line_squares(xy, index, n)
        if n * math.log((corner + least) / (squares + least)) < 2.0 * LEAST_LIKELIHOOD:
            return False
    row[CX], row[CY], row[RADIUS] = circle[0], circle[1], r
    row[VAR_XX], row[VAR_XY], row[VAR_YY], row[VAR_RADIUS] = C[0, 0], C[0, 1], C[1, 1], C[2, 2]
    row[SENSE], row[ARC], row[POINTS] = sense, arc, n
    return True


@kernel
def try_circle(xy, index, n, sigma, circle, A, C, row, strict):  # type: ignore[no-untyped-def]
    """Fit and judge: False where points index[:n] are no circle's, else `circle` and `row` are."""
    most = 3.0 * n * (MOST_SPREAD * sigma) ** 2
    squares = geometric_circle(xy, index, n, most, circle, A, C)
    return squares >= 0.0 and judge_circle(xy, index, n, sigma, circle, squares, C, row, strict)


@kernel
def adopt_points(xy, circle, sense, sigma, index):  # type: ignore[no-untyped-def]
    """All points of the scan that lie on a circle, what hides parts of it left out; their count."""
    count = 0
    for k in range(xy.shape[0]):
        dx, dy = xy[k, 0] - circle[0], xy[k, 1] - circle[1]
        facing = -(dx * xy[k, 0] + dy * xy[k, 1])
        if facing * sense > 0.0 and abs(math.hypot(dx, dy) - circle[2]) < 3.0 * sigma:
            index[count] = k
            count += 1
    return count


@kernel
def bent_runs(lines, place, turns):  # type: ignore[no-untyped-def]
    """Fill `turns` with (first, last) point of runs of chords that turn one way; their count.

    place: index of each beam's point, -1 where there is none. Two chords at least. A chord is a
    line no longer than LONGEST_CHORD, so that long walls cost nothing.
    """
    count = 0
    first = 0
    n = lines.shape[0]
    while first < n:
        last = first
        way = 0.0
        while last + 1 < n and lines[last, LENGTH] < LONGEST_CHORD:
            a, b = place[int(lines[last, LAST])], place[int(lines[last + 1, FIRST])]
            d = lines[last + 1, THETA] - lines[last, THETA]
            d -= 2.0 * math.pi * math.floor((d + math.pi) / (2.0 * math.pi))
            bent = LEAST_TURN < abs(d) < MOST_TURN and (way == 0.0 or d * way > 0.0)
            if not bent or b - a > 3 or b < a or lines[last + 1, LENGTH] >= LONGEST_CHORD:
                break
            way = d
            last += 1
        if last > first:
            turns[count, 0] = place[int(lines[first, FIRST])]
            turns[count, 1] = place[int(lines[last, LAST])]
            count += 1
        first = max(last, first + 1)
    return count


@kernel
def round_clusters(xy, breaks, min_points, spans):  # type: ignore[no-untyped-def]
    """Fill `spans` with (first, last) of small surfaces bent like an arc; their count.

    Like an arc: deepest near the middle of the chord, and deep enough for its length.
    """
    count = 0
    first = 0
    for last in range(xy.shape[0]):
        if not breaks[last]:
            continue
        dx, dy = xy[last, 0] - xy[first, 0], xy[last, 1] - xy[first, 1]
        small = dx * dx + dy * dy < WIDEST_COLUMN * WIDEST_COLUMN
        if last - first + 1 >= min_points and small:
            where, deep = farthest_from_chord(xy, first, last)
            chord = dx * dx + dy * dy
            along = dx * (xy[where, 0] - xy[first, 0]) + dy * (xy[where, 1] - xy[first, 1])
            middle = 0.2 * chord < along < 0.8 * chord
            if deep > LEAST_SAGITTA and deep * deep > 0.008 * chord and middle:
                spans[count, 0], spans[count, 1] = first, last
                count += 1
        first = last + 1
    return count


@kernel
def find_circles(xy, beam, breaks, lines, beams, sigma, min_points):  # type: ignore[no-untyped-def]
    """Circles of one scan, rows of CIRCLE_COLUMNS: small round surfaces, then runs of chords.

    A round wall that columns hide in part is several runs: each circle takes in all points of the
    scan that lie on it and is fitted once more.
    """
    n = xy.shape[0]
    spans = np.empty((n + lines.shape[0] + 1, 2), dtype=np.int64)
    small = round_clusters(xy, breaks, min_points, spans)
    count = small
    if lines.shape[0] > 1:
        place = np.full(beams, -1, dtype=np.int64)
        for k in range(n):
            place[beam[k]] = k
        count += bent_runs(lines, place, spans[small:])
    out = np.empty((count, CIRCLE_COLUMNS))
    if count == 0:
        return out
    index = np.empty(n, dtype=np.int64)
    circle, A, C = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    taken = np.zeros(n, dtype=np.bool_)
    kept = 0
    for s in range(count):
        a, m = spans[s, 0], spans[s, 1] - spans[s, 0] + 1
        if taken[(spans[s, 0] + spans[s, 1]) // 2] or m < min_points:
            continue
        for q in range(m):
            index[q] = a + q
        if not try_circle(xy, index, m, sigma, circle, A, C, out[kept], s < small):
            continue
        if s >= small:
            whole = False
            for q in range(ADOPTIONS):
                m = adopt_points(xy, circle, out[kept, SENSE], sigma, index)
                whole = try_circle(xy, index, m, sigma, circle, A, C, out[kept], q == ADOPTIONS - 1)
                if not whole:
                    break
            if not whole:
                continue
        first, last = beam[index[0]], beam[index[0]]
        for q in range(m):
            taken[index[q]] = True
            first, last = min(first, beam[index[q]]), max(last, beam[index[q]])
        out[kept, BEGIN], out[kept, END] = first, last
        kept += 1
    return out[:kept]


@kernel
def chords(lines, circles, reach):  # type: ignore[no-untyped-def]
    """(n,) True for lines that are pieces of a circle's surface: both ends and the middle on it."""
    out = np.zeros(lines.shape[0], dtype=np.bool_)
    for i in range(lines.shape[0]):
        for k in range(circles.shape[0]):
            on = 0
            for q in range(3):
                x = lines[i, X1] + 0.5 * q * (lines[i, X2] - lines[i, X1])
                y = lines[i, Y1] + 0.5 * q * (lines[i, Y2] - lines[i, Y1])
                off = math.hypot(x - circles[k, CX], y - circles[k, CY]) - circles[k, RADIUS]
                if abs(off) < reach:
                    on += 1
            out[i] = out[i] or on == 3
    return out
