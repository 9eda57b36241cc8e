"""Numba kernels of the default matcher. Slow twins: tests/core/matching/slow_twins.py.

Lines are rows as `ScanFeatures.lines` describes them; ends and edges go with them. A sweep for
the free-space check is (ranges, angle_min, angle_increment) at a pose (x, y, theta).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lineloom_core.features._kernels import (
    EDGE,
    LENGTH,
    OFFSET,
    THETA,
    VAR_OFFSET,
    VAR_THETA,
    X1,
    X2,
    Y1,
    Y2,
)

BINS = 360
LONG_ENOUGH = 3.0
COARSE_STEP, FINE_STEP = 6, 2
MATCHED, CONFLICT, OCCLUDED, OUTSIDE = 0, 1, 2, 3


@njit(cache=True)
def wrap_angle(a):  # type: ignore[no-untyped-def]
    """Wrap to [-pi, pi)."""
    return a - 2.0 * math.pi * math.floor((a + math.pi) / (2.0 * math.pi))


@njit(cache=True)
def rotation_histogram(ref, cur):  # type: ignore[no-untyped-def]
    """Direction differences of all pairs of oriented lines, one degree a bin, shared over two."""
    h = np.zeros(BINS)
    scale = BINS / (2.0 * math.pi)
    for i in range(ref.shape[0]):
        for j in range(cur.shape[0]):
            w = min(ref[i, LENGTH], cur[j, LENGTH], LONG_ENOUGH)
            d = (wrap_angle(ref[i, THETA] - cur[j, THETA]) + math.pi) * scale - 0.5
            k = math.floor(d)
            f = d - k
            h[k % BINS] += w * (1.0 - f)
            h[(k + 1) % BINS] += w * f
    return h


@njit(cache=True)
def rotation_peaks(ref, cur, most, least_share, reach):  # type: ignore[no-untyped-def]
    """Rotations phi with theta_ref = theta_cur + phi that many pairs agree on, best first."""
    h = rotation_histogram(ref, cur)
    smooth = np.empty(BINS)
    for k in range(BINS):
        smooth[k] = (
            h[(k - 2) % BINS] + 2.0 * h[(k - 1) % BINS] + 3.0 * h[k]
            + 2.0 * h[(k + 1) % BINS] + h[(k + 2) % BINS]
        )  # fmt: skip
    peaks = np.empty(most)
    used = np.zeros(BINS, dtype=np.bool_)
    count = 0
    best = smooth.max()
    while count < most:
        top, where = 0.0, -1
        for k in range(BINS):
            if not used[k] and smooth[k] > top:
                top, where = smooth[k], k
        if where < 0 or top < least_share * best:
            break
        for k in range(where - 4, where + 5):
            used[k % BINS] = True
        centre = (where + 0.5) * 2.0 * math.pi / BINS - math.pi
        total, mean = 0.0, 0.0
        for i in range(ref.shape[0]):
            for j in range(cur.shape[0]):
                d = wrap_angle(ref[i, THETA] - cur[j, THETA] - centre)
                if abs(d) < reach:
                    w = min(ref[i, LENGTH], cur[j, LENGTH], LONG_ENOUGH)
                    w = w * w
                    total += w
                    mean += w * d
        if total > 0.0:
            centre = wrap_angle(centre + mean / total)
        peaks[count] = centre
        count += 1
    return peaks[:count]


@njit(cache=True)
def compatible_pairs(ref, cur, phi, tolerance, most, pairs):  # type: ignore[no-untyped-def]
    """Pairs (i, j) whose directions agree under phi; the `most` heaviest. Returns their count."""
    count = 0
    lightest = np.inf
    weights = np.empty(most)
    for i in range(ref.shape[0]):
        for j in range(cur.shape[0]):
            d = abs(wrap_angle(ref[i, THETA] - cur[j, THETA] - phi))
            if d > tolerance:
                continue
            w = min(ref[i, LENGTH], cur[j, LENGTH])
            if count < most:
                pairs[count, 0], pairs[count, 1] = i, j
                weights[count] = w
                count += 1
            else:
                if lightest == np.inf:
                    lightest = weights.min()
                if w > lightest:
                    k = int(weights.argmin())
                    pairs[k, 0], pairs[k, 1] = i, j
                    weights[k] = w
                    lightest = weights.min()
    return count


@njit(cache=True)
def overlap_length(line, ux, uy, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Length that segment a-b shares with `line` when projected on its direction (ux, uy)."""
    s = ux * line[X1] + uy * line[Y1]
    ta, tb = ux * ax + uy * ay, ux * bx + uy * by
    return min(max(ta, tb), s + line[LENGTH]) - max(min(ta, tb), s)


@njit(cache=True)
def vote_translations(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, phi, pairs, count, cell, half, grid, touched
):
    """Vote for translations: two non-parallel constraints meet in one point; same edges coincide.

    grid: (3, n, n) zeros: weight and weighted x, y. touched: scratch. Returns touched cells.
    """
    n = grid.shape[1]
    c, s = math.cos(phi), math.sin(phi)
    offs = np.empty(count)
    nx, ny = np.empty(count), np.empty(count)
    ends = np.empty((count, 4))
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        nx[p], ny[p] = -math.sin(ref[i, THETA]), math.cos(ref[i, THETA])
        ends[p, 0] = c * cur[j, X1] - s * cur[j, Y1]
        ends[p, 1] = s * cur[j, X1] + c * cur[j, Y1]
        ends[p, 2] = c * cur[j, X2] - s * cur[j, Y2]
        ends[p, 3] = s * cur[j, X2] + c * cur[j, Y2]
        mx, my = 0.5 * (ends[p, 0] + ends[p, 2]), 0.5 * (ends[p, 1] + ends[p, 3])
        offs[p] = ref[i, OFFSET] - (nx[p] * mx + ny[p] * my)
    used = 0
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        wp = min(ref[i, LENGTH], cur[j, LENGTH], LONG_ENOUGH)
        for side in range(2):
            if ref_ends[i, side] == EDGE and cur_ends[j, side] == EDGE:
                ex = c * cur_edges[j, side, 0] - s * cur_edges[j, side, 1]
                ey = s * cur_edges[j, side, 0] + c * cur_edges[j, side, 1]
                tx, ty = ref_edges[i, side, 0] - ex, ref_edges[i, side, 1] - ey
                gx, gy = math.floor((tx + half) / cell), math.floor((ty + half) / cell)
                if 0 <= gx < n and 0 <= gy < n:
                    if grid[0, gx, gy] == 0.0:
                        touched[used, 0], touched[used, 1] = gx, gy
                        used += 1
                    w = 0.7 * min(wp, 1.0)
                    grid[0, gx, gy] += w
                    grid[1, gx, gy] += w * tx
                    grid[2, gx, gy] += w * ty
        for q in range(p + 1, count):
            k, m = pairs[q, 0], pairs[q, 1]
            if i == k or j == m:
                continue
            sine = nx[p] * ny[q] - ny[p] * nx[q]
            if abs(sine) < 0.3:
                continue
            tx = (offs[p] * ny[q] - offs[q] * ny[p]) / sine
            ty = (nx[p] * offs[q] - nx[q] * offs[p]) / sine
            gx, gy = math.floor((tx + half) / cell), math.floor((ty + half) / cell)
            if gx < 0 or gy < 0 or gx >= n or gy >= n:
                continue
            op = overlap_length(ref[i], ny[p], -nx[p], ends[p, 0] + tx, ends[p, 1] + ty,
                                ends[p, 2] + tx, ends[p, 3] + ty)  # fmt: skip
            if op < 0.3 * min(ref[i, LENGTH], cur[j, LENGTH]):
                continue
            oq = overlap_length(ref[k], ny[q], -nx[q], ends[q, 0] + tx, ends[q, 1] + ty,
                                ends[q, 2] + tx, ends[q, 3] + ty)  # fmt: skip
            if oq < 0.3 * min(ref[k, LENGTH], cur[m, LENGTH]):
                continue
            w = math.sqrt(min(op, LONG_ENOUGH) * min(oq, LONG_ENOUGH))
            if grid[0, gx, gy] == 0.0:
                if used >= touched.shape[0]:
                    continue
                touched[used, 0], touched[used, 1] = gx, gy
                used += 1
            grid[0, gx, gy] += w
            grid[1, gx, gy] += w * tx
            grid[2, gx, gy] += w * ty
    return used


@njit(cache=True)
def vote_peaks(grid, touched, used, most, out):  # type: ignore[no-untyped-def]
    """The best cells (3 x 3 sums, non-maxima suppressed) as rows x, y, votes; clears the grid."""
    n = grid.shape[1]
    sums = np.empty(used)
    for t in range(used):
        total = 0.0
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                gx, gy = touched[t, 0] + dx, touched[t, 1] + dy
                if 0 <= gx < n and 0 <= gy < n:
                    total += grid[0, gx, gy]
        sums[t] = total
    count = 0
    while count < most:
        top, where = 0.0, -1
        for t in range(used):
            if sums[t] > top:
                top, where = sums[t], t
        if where < 0:
            break
        gx0, gy0 = touched[where, 0], touched[where, 1]
        sx = sy = total = 0.0
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                gx, gy = gx0 + dx, gy0 + dy
                if 0 <= gx < n and 0 <= gy < n:
                    total += grid[0, gx, gy]
                    sx += grid[1, gx, gy]
                    sy += grid[2, gx, gy]
        out[count, 0], out[count, 1], out[count, 2] = sx / total, sy / total, top
        count += 1
        for t in range(used):
            if abs(touched[t, 0] - gx0) <= 1 and abs(touched[t, 1] - gy0) <= 1:
                sums[t] = -1.0
    for t in range(used):
        for k in range(3):
            grid[k, touched[t, 0], touched[t, 1]] = 0.0
    return count


@njit(cache=True)
def explained_length(ref, cur, phi, pairs, count, tx, ty, reach, taken):  # type: ignore[no-untyped-def]
    """Length of current lines that lie on reference lines, nearer counts more, each once."""
    c, s = math.cos(phi), math.sin(phi)
    taken[:] = 0.0
    for p in range(count):
        i, j = pairs[p, 0], pairs[p, 1]
        ux, uy = math.cos(ref[i, THETA]), math.sin(ref[i, THETA])
        ax, ay = c * cur[j, X1] - s * cur[j, Y1] + tx, s * cur[j, X1] + c * cur[j, Y1] + ty
        bx, by = c * cur[j, X2] - s * cur[j, Y2] + tx, s * cur[j, X2] + c * cur[j, Y2] + ty
        distance = abs(0.5 * (ux * (ay + by) - uy * (ax + bx)) - ref[i, OFFSET])
        if distance > reach:
            continue
        shared = overlap_length(ref[i], ux, uy, ax, ay, bx, by)
        if shared > 0.0:
            taken[j] = max(taken[j], shared * (1.0 - 0.5 * distance / reach))
    return taken.sum()


@njit(cache=True)
def propose(  # type: ignore[no-untyped-def]
    ref,
    ref_ends,
    ref_edges,
    cur,
    cur_ends,
    cur_edges,
    rotations,
    cells,
    least_share,
    pair_limit,
    cell,
    half,
    reach,
):
    """Steps 1 to 3: rows x, y, theta, explained length, votes; best explained first."""
    phis = rotation_peaks(ref, cur, rotations, least_share, math.radians(3.0))
    table = np.empty((phis.shape[0] * cells, 5))
    n = int(2.0 * half / cell) + 1
    grid = np.zeros((3, n, n))
    pairs = np.empty((pair_limit, 2), dtype=np.int64)
    touched = np.empty((min(n * n, pair_limit * pair_limit), 2), dtype=np.int64)
    peaks = np.empty((cells, 3))
    taken = np.empty(cur.shape[0])
    rows = 0
    for f in range(phis.shape[0]):
        phi = phis[f]
        count = compatible_pairs(ref, cur, phi, math.radians(6.0), pair_limit, pairs)
        used = vote_translations(
            ref, ref_ends, ref_edges, cur, cur_ends, cur_edges,
            phi, pairs, count, cell, half, grid, touched,
        )  # fmt: skip
        found = vote_peaks(grid, touched, used, cells, peaks)
        for k in range(found):
            tx, ty = peaks[k, 0], peaks[k, 1]
            table[rows, 0], table[rows, 1], table[rows, 2] = tx, ty, phi
            table[rows, 3] = explained_length(ref, cur, phi, pairs, count, tx, ty, reach, taken)
            table[rows, 4] = peaks[k, 2]
            rows += 1
    order = np.argsort(-table[:rows, 3], kind="mergesort")
    return table[:rows][order]


@njit(cache=True)
def solve3(A, b):  # type: ignore[no-untyped-def]
    """Solve a symmetric 3x3 system by Cramer's rule; zeros where singular."""
    c00 = A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]
    c01 = A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2]
    c02 = A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0]
    det = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    x = np.zeros(3)
    if abs(det) < 1e-12:
        return x
    x[0] = (b[0] * c00 + b[1] * (A[0, 2] * A[2, 1] - A[0, 1] * A[2, 2])
            + b[2] * (A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1])) / det  # fmt: skip
    x[1] = (b[0] * c01 + b[1] * (A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0])
            + b[2] * (A[0, 2] * A[1, 0] - A[0, 0] * A[1, 2])) / det  # fmt: skip
    x[2] = (b[0] * c02 + b[1] * (A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1])
            + b[2] * (A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0])) / det  # fmt: skip
    return x


@njit(cache=True)
def accumulate_lines(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, pose, angle_gate, distance_gate, H, g
):
    """Add the normal equations of point-to-line, angle and end-point residuals at `pose`.

    Residuals of current lines against reference lines, parameters (x, y, theta) of
    T_reference_current. Returns the overlapped length.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    tx, ty = pose[0], pose[1]
    total = 0.0
    for j in range(cur.shape[0]):
        ax, ay = c * cur[j, X1] - s * cur[j, Y1] + tx, s * cur[j, X1] + c * cur[j, Y1] + ty
        bx, by = c * cur[j, X2] - s * cur[j, Y2] + tx, s * cur[j, X2] + c * cur[j, Y2] + ty
        theta = cur[j, THETA] + pose[2]
        for i in range(ref.shape[0]):
            da = wrap_angle(ref[i, THETA] - theta)
            if abs(da) > angle_gate:
                continue
            ux, uy = math.cos(ref[i, THETA]), math.sin(ref[i, THETA])
            nx, ny = -uy, ux
            ea, eb = nx * ax + ny * ay - ref[i, OFFSET], nx * bx + ny * by - ref[i, OFFSET]
            # Clip the current segment to the reference one: only the shared part is evidence.
            s1 = ux * ref[i, X1] + uy * ref[i, Y1]
            s2 = s1 + ref[i, LENGTH]
            ta, tb = ux * ax + uy * ay, ux * bx + uy * by
            if tb - ta < 1e-6:
                continue
            lo, hi = max(ta, s1), min(tb, s2)
            shared = hi - lo
            if shared < 0.3 * min(ref[i, LENGTH], cur[j, LENGTH]):
                continue
            slope = (eb - ea) / (tb - ta)
            middle = 0.5 * (lo + hi)
            e = ea + slope * (middle - ta)
            if abs(e) > distance_gate:
                continue
            total += shared
            # The middle of the shared part, across the line.
            px, py = (
                ux * middle + nx * (ref[i, OFFSET] + e),
                uy * middle + ny * (ref[i, OFFSET] + e),
            )
            mr = middle - 0.5 * (s1 + s2)
            mc = middle - 0.5 * (ta + tb)
            var = (ref[i, VAR_OFFSET] + cur[j, VAR_OFFSET] + 4e-5
                   + ref[i, VAR_THETA] * mr * mr + cur[j, VAR_THETA] * mc * mc)  # fmt: skip
            sigma = math.sqrt(var)
            w = 1.0 / var
            if abs(e) > 3.0 * sigma:
                w *= 3.0 * sigma / abs(e)
            j2 = -nx * (py - ty) + ny * (px - tx)
            H[0, 0] += w * nx * nx
            H[0, 1] += w * nx * ny
            H[0, 2] += w * nx * j2
            H[1, 1] += w * ny * ny
            H[1, 2] += w * ny * j2
            H[2, 2] += w * j2 * j2
            g[0] -= w * nx * e
            g[1] -= w * ny * e
            g[2] -= w * j2 * e
            # Direction.
            var = ref[i, VAR_THETA] + cur[j, VAR_THETA] + 1e-5
            w = 1.0 / var
            if da * da > 9.0 * var:
                w *= 3.0 * math.sqrt(var) / abs(da)
            H[2, 2] += w
            g[2] += w * da
            # End points: a corner seen in both scans fixes the slide along the line.
            for side in range(2):
                if ref_ends[i, side] != EDGE or cur_ends[j, side] != EDGE:
                    continue
                qx = c * cur_edges[j, side, 0] - s * cur_edges[j, side, 1]
                qy = s * cur_edges[j, side, 0] + c * cur_edges[j, side, 1]
                e = ux * (qx + tx - ref_edges[i, side, 0]) + uy * (qy + ty - ref_edges[i, side, 1])
                if abs(e) > distance_gate:
                    continue
                var = 0.0025
                w = 1.0 / var
                if e * e > 4.0 * var:
                    w *= 2.0 * math.sqrt(var) / abs(e)
                j2 = -ux * qy + uy * qx
                H[0, 0] += w * ux * ux
                H[0, 1] += w * ux * uy
                H[0, 2] += w * ux * j2
                H[1, 1] += w * uy * uy
                H[1, 2] += w * uy * j2
                H[2, 2] += w * j2 * j2
                g[0] -= w * ux * e
                g[1] -= w * uy * e
                g[2] -= w * j2 * e
    H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
    return total


@njit(cache=True)
def refine(  # type: ignore[no-untyped-def]
    ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, pose, H, iterations
):
    """Step 4: Gauss-Newton on lines, shrinking gates. Moves `pose`, fills H; returns overlap."""
    angle_gate, distance_gate = math.radians(7.0), 0.25
    total = 0.0
    g = np.zeros(3)
    for it in range(iterations + 1):
        H[:] = 0.0
        g[:] = 0.0
        total = accumulate_lines(
            ref, ref_ends, ref_edges, cur, cur_ends, cur_edges,
            pose, angle_gate, distance_gate, H, g,
        )  # fmt: skip
        if it == iterations or total == 0.0:
            break
        A = H.copy()
        # A weak prior keeps what no line constrains where the hypothesis put it.
        A[0, 0] += 25.0
        A[1, 1] += 25.0
        A[2, 2] += 100.0
        d = solve3(A, g)
        pose[0] += d[0]
        pose[1] += d[1]
        pose[2] = wrap_angle(pose[2] + d[2])
        angle_gate = max(angle_gate * 0.7, math.radians(3.0))
        distance_gate = max(distance_gate * 0.7, 0.12)
    return total


@njit(cache=True)
def bearing(y, x):  # type: ignore[no-untyped-def]
    """atan2 to within 1e-5 rad, a thousandth of a beam's spacing, in a third of the time."""
    ax, ay = abs(x), abs(y)
    high = max(ax, ay)
    if high == 0.0:
        return 0.0
    t = min(ax, ay) / high
    q = t * t
    a = t * (0.99997726 + q * (-0.33262347 + q * (0.19354346 + q * (
        -0.11643287 + q * (0.05265332 - 0.01172120 * q)))))  # fmt: skip
    if ay > ax:
        a = 0.5 * math.pi - a
    if x < 0.0:
        a = math.pi - a
    return -a if y < 0.0 else a


@njit(cache=True)
def beam_of(x, y, angle_min, per_radian, turn):  # type: ignore[no-untyped-def]
    """The beam nearest to the direction of (x, y); may be beyond the last one."""
    f = (bearing(y, x) - angle_min) * per_radian + 0.5
    if f < 0.0:
        f += turn
    elif f >= turn:
        f -= turn
    if f < 0.0 or f >= turn:  # angle_min more than a turn away
        f -= turn * math.floor(f / turn)
    return int(f)


@njit(cache=True)
def judge_point(x, y, ranges, angle_min, per_radian, turn, base, slope):  # type: ignore[no-untyped-def]
    """One point in the frame of one sweep: MATCHED, CONFLICT, OCCLUDED or OUTSIDE.

    A conflict is a point in front of what the beam measured; a beam without return proves nothing.
    per_radian: beams per radian; turn: beams per full turn.
    """
    n = ranges.shape[0]
    b = beam_of(x, y, angle_min, per_radian, turn)
    if b >= n:
        return OUTSIDE
    r = ranges[b]
    if not math.isfinite(r):
        return OUTSIDE
    rho = math.sqrt(x * x + y * y)
    tol = base + slope * rho
    if abs(rho - r) <= tol:
        return MATCHED
    nearest = r
    for q in (b - 1, b + 1):
        if 0 <= q < n:
            p = ranges[q]
            if not math.isfinite(p):
                continue
            # Between two neighbouring returns the surface is anywhere between their ranges.
            if abs(rho - p) <= tol or (abs(p - r) < 0.5 and (p - rho) * (r - rho) <= 0.0):
                return MATCHED
            nearest = min(nearest, p)
    return CONFLICT if rho < nearest - tol else OCCLUDED


@njit(cache=True)
def judge_points(  # type: ignore[no-untyped-def]
    points, spacing, step, pose, ranges, angle_min, angle_increment, base, slope, counts
):
    """Step 5, one way: hold points, moved by `pose`, against a sweep in polar form.

    counts[MATCHED, CONFLICT, OCCLUDED, OUTSIDE] grow by each point's weight, its share of wall:
    the distance of neighbouring beams there, at most 5 cm, so that near clutter does not outvote.
    spacing: angle between the beams that measured the points, which may be of another lidar.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    per_radian = 1.0 / angle_increment
    turn = 2.0 * math.pi * per_radian
    for k in range(0, points.shape[0], step):
        px, py = points[k, 0], points[k, 1]
        w = min(math.sqrt(px * px + py * py) * spacing, 0.05)
        x = c * px - s * py + pose[0]
        y = s * px + c * py + pose[1]
        counts[judge_point(x, y, ranges, angle_min, per_radian, turn, base, slope)] += w


@njit(cache=True)
def judge_cloud(  # type: ignore[no-untyped-def]
    points, step, pose, ranges, angle_mins, angle_increments, poses, base, slope, counts
):
    """Hold points (frame A, moved by `pose` into frame B) against all sweeps of B.

    ranges (k, n), angle_mins, angle_increments (k,), poses (k, 3) of the sweeps in B. A point is
    matched where at least as many sweeps measured it as saw through it.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    sweeps = ranges.shape[0]
    cs, ss = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    per_radian = 1.0 / angle_increments
    turns = 2.0 * math.pi * per_radian
    for k in range(0, points.shape[0], step):
        x = c * points[k, 0] - s * points[k, 1] + pose[0]
        y = s * points[k, 0] + c * points[k, 1] + pose[1]
        hits = misses = behind = 0
        for q in range(sweeps):
            dx, dy = x - poses[q, 0], y - poses[q, 1]
            verdict = judge_point(
                cs[q] * dx + ss[q] * dy, cs[q] * dy - ss[q] * dx, ranges[q],
                angle_mins[q], per_radian[q], turns[q], base, slope,
            )  # fmt: skip
            if verdict == MATCHED:
                hits += 1
            elif verdict == CONFLICT:
                misses += 1
            elif verdict == OCCLUDED:
                behind += 1
        if hits > 0 and hits >= misses:
            counts[MATCHED] += 1.0
        elif misses > 0:
            counts[CONFLICT] += 1.0
        elif behind > 0:
            counts[OCCLUDED] += 1.0
        else:
            counts[OUTSIDE] += 1.0


@njit(cache=True)
def invert_pose(pose, out):  # type: ignore[no-untyped-def]
    """out = pose^-1."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out[0] = -c * pose[0] - s * pose[1]
    out[1] = s * pose[0] - c * pose[1]
    out[2] = -pose[2]


@njit(cache=True)
def judge_pair(  # type: ignore[no-untyped-def]
    ref_points,
    ref_ranges,
    ref_min,
    ref_inc,
    cur_points,
    cur_ranges,
    cur_min,
    cur_inc,
    pose,
    step,
    base,
    slope,
    counts,
):
    """Free-space check both ways between two single sweeps; counts (4,) is overwritten."""
    counts[:] = 0.0
    judge_points(cur_points, cur_inc, step, pose, ref_ranges, ref_min, ref_inc, base, slope, counts)
    back = np.empty(3)
    invert_pose(pose, back)
    judge_points(ref_points, ref_inc, step, back, cur_ranges, cur_min, cur_inc, base, slope, counts)


@njit(cache=True)
def match_sweeps(  # type: ignore[no-untyped-def]
    ref,
    ref_ends,
    ref_edges,
    ref_points,
    ref_ranges,
    ref_min,
    ref_inc,
    cur,
    cur_ends,
    cur_edges,
    cur_points,
    cur_ranges,
    cur_min,
    cur_inc,
    rotations,
    cells,
    least_share,
    pair_limit,
    cell,
    half,
    reach,
    coarse_keep,
    fine_keep,
    iterations,
    base,
    slope,
):
    """Steps 1 to 6 on two sweeps.

    Returns the refined hypotheses, best first, as rows
    x, y, theta, explained, votes, matched, conflict, occluded, outside, overlap, H (6 numbers).
    """
    proposals = propose(
        ref, ref_ends, ref_edges, cur, cur_ends, cur_edges,
        rotations, cells, least_share, pair_limit, cell, half, reach,
    )  # fmt: skip
    n = min(proposals.shape[0], coarse_keep)
    counts = np.zeros(4)
    rank = np.empty(n)
    for k in range(n):
        judge_pair(
            ref_points, ref_ranges, ref_min, ref_inc, cur_points, cur_ranges, cur_min, cur_inc,
            proposals[k, :3], COARSE_STEP, base + 0.15, slope + 0.01, counts,
        )  # fmt: skip
        rank[k] = proposals[k, 3] + COARSE_STEP * (counts[MATCHED] - 2.0 * counts[CONFLICT])
    order = np.argsort(-rank, kind="mergesort")
    m = min(n, fine_keep)
    out = np.empty((m, 16))
    H = np.empty((3, 3))
    kept = 0
    for q in range(m):
        row = proposals[order[q]]
        pose = row[:3].copy()
        overlap = refine(ref, ref_ends, ref_edges, cur, cur_ends, cur_edges, pose, H, iterations)
        if overlap == 0.0:
            continue
        twin = False
        for k in range(kept):
            near = math.hypot(out[k, 0] - pose[0], out[k, 1] - pose[1]) < 0.08
            twin = twin or (near and abs(wrap_angle(out[k, 2] - pose[2])) < 0.03)
        if twin:
            continue
        judge_pair(
            ref_points, ref_ranges, ref_min, ref_inc, cur_points, cur_ranges, cur_min, cur_inc,
            pose, FINE_STEP, base, slope, counts,
        )  # fmt: skip
        out[kept, :3] = pose
        out[kept, 3], out[kept, 4] = row[3], row[4]
        out[kept, 5:9] = FINE_STEP * counts
        out[kept, 9] = overlap
        out[kept, 10], out[kept, 11], out[kept, 12] = H[0, 0], H[0, 1], H[0, 2]
        out[kept, 13], out[kept, 14], out[kept, 15] = H[1, 1], H[1, 2], H[2, 2]
        kept += 1
    rank = np.empty(kept)
    for k in range(kept):
        rank[k] = evidence(out[k])
    return out[:kept][np.argsort(-rank, kind="mergesort")]


@njit(cache=True)
def evidence(row):  # type: ignore[no-untyped-def]
    """What speaks for a hypothesis, in metres of wall: overlap and matched, less conflicts."""
    return row[9] + row[5] - 3.0 * row[6]


@njit(cache=True)
def lying_pairs(ref, cur, pose, angle_gate, distance_gate, least_overlap):  # type: ignore[no-untyped-def]
    """Rows i, j, overlap, distance, angle of the lines that lie on each other under `pose`."""
    out = np.empty((ref.shape[0] * cur.shape[0], 5))
    count = 0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(ref.shape[0]):
        ux, uy = math.cos(ref[i, THETA]), math.sin(ref[i, THETA])
        for j in range(cur.shape[0]):
            angle = wrap_angle(cur[j, THETA] + pose[2] - ref[i, THETA])
            if abs(angle) > angle_gate:
                continue
            ax = c * cur[j, X1] - s * cur[j, Y1] + pose[0]
            ay = s * cur[j, X1] + c * cur[j, Y1] + pose[1]
            bx = c * cur[j, X2] - s * cur[j, Y2] + pose[0]
            by = s * cur[j, X2] + c * cur[j, Y2] + pose[1]
            distance = abs(0.5 * (ux * (ay + by) - uy * (ax + bx)) - ref[i, OFFSET])
            shared = overlap_length(ref[i], ux, uy, ax, ay, bx, by)
            if distance > distance_gate or shared < least_overlap:
                continue
            out[count, 0], out[count, 1], out[count, 2] = i, j, shared
            out[count, 3], out[count, 4] = distance, angle
            count += 1
    return out[:count]
