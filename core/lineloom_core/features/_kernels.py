"""Numba kernels of feature extraction. Each has a slow twin in tests/core/features/slow_twins.py.

A line is a row of LINE_COLUMNS numbers (see `ScanFeatures.lines`); `Line` names the columns.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel

X1, Y1, X2, Y2, THETA, OFFSET, LENGTH, VAR_THETA, VAR_OFFSET, COUNT, FIRST, LAST = range(12)
LINE_COLUMNS = 12
INTERIOR, EDGE, UNKNOWN = 0, 1, 2
OPEN_CHAINS = 4


@kernel
def to_points(ranges, angle_min, angle_increment):  # type: ignore[no-untyped-def]
    """Finite returns as (n, 2) points and their beam indices (§3.1.3)."""
    n = ranges.shape[0]
    xy = np.empty((n, 2))
    beam = np.empty(n, dtype=np.int64)
    m = 0
    # One rotation per beam instead of one sine and cosine; renewed often enough that the
    # accumulated rounding stays below 1e-14.
    c = s = 0.0
    dc, ds = math.cos(angle_increment), math.sin(angle_increment)
    for i in range(n):
        if i % 64 == 0:
            a = angle_min + i * angle_increment
            c, s = math.cos(a), math.sin(a)
        r = ranges[i]
        if math.isfinite(r):
            xy[m, 0] = r * c
            xy[m, 1] = r * s
            beam[m] = i
            m += 1
        c, s = c * dc - s * ds, s * dc + c * ds
    return xy[:m], beam[:m]


@kernel
def cluster_points(xy, beam, ranges, angle_increment, lam, sigma, max_gap_beams):  # type: ignore[no-untyped-def]
    """Chain points into surfaces by adaptive break points; return their order and chain ends.

    Behind glass or a grille, neighbouring beams alternate between two surfaces. So a point may
    continue any of the last OPEN_CHAINS chains, the nearest that admits it, not only the newest.
    Returns `order` (m,) the points chain by chain, and `breaks` (m,) True at a chain's last point.
    """
    n = xy.shape[0]
    chain = np.empty(n, dtype=np.int64)
    tail = np.empty(n + 1, dtype=np.int64)
    size = np.zeros(n + 1, dtype=np.int64)
    chains = 0
    for k in range(n):
        best, best_d2 = -1, np.inf
        for c in range(chains - 1, max(chains - 1 - OPEN_CHAINS, -1), -1):
            t = tail[c]
            gap = beam[k] - beam[t]
            if gap > max_gap_beams:
                continue
            dphi = gap * angle_increment
            r = min(ranges[beam[t]], ranges[beam[k]])
            # lam is the flattest incidence trusted; it must stay above the beam spacing itself.
            flattest = max(lam, 1.5 * dphi)
            limit = r * math.sin(dphi) / math.sin(flattest - 0.7 * dphi) + 3.0 * sigma
            d2 = (xy[k, 0] - xy[t, 0]) ** 2 + (xy[k, 1] - xy[t, 1]) ** 2
            if d2 < limit * limit and d2 < best_d2:
                best, best_d2 = c, d2
        if best < 0:
            best = chains
            chains += 1
        chain[k] = best
        tail[best] = k
        size[best] += 1
    start = np.zeros(chains + 1, dtype=np.int64)
    for c in range(chains):
        start[c + 1] = start[c] + size[c]
    breaks = np.zeros(n, dtype=np.bool_)
    for c in range(chains):
        breaks[start[c + 1] - 1] = True
    order = np.empty(n, dtype=np.int64)
    for k in range(n):
        order[start[chain[k]]] = k
        start[chain[k]] += 1
    return order, breaks


@kernel
def farthest_from_chord(xy, a, b):  # type: ignore[no-untyped-def]
    """Index and distance of the point of a..b farthest from the chord a-b (iterative end point)."""
    ux, uy = xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1]
    norm = math.hypot(ux, uy)
    best, where = -1.0, a
    for k in range(a + 1, b):
        px, py = xy[k, 0] - xy[a, 0], xy[k, 1] - xy[a, 1]
        d = math.hypot(px, py) if norm < 1e-9 else abs(ux * py - uy * px) / norm
        if d > best:
            best, where = d, k
    return where, best


@kernel
def split_clusters(xy, breaks, threshold, runs):  # type: ignore[no-untyped-def]
    """Algorithm 1, the split: fill `runs` (first, last, cluster) in order; return their count."""
    n = xy.shape[0]
    count = 0
    cluster = 0
    start = 0
    stack = np.empty((64, 2), dtype=np.int64)
    for k in range(n):
        if not breaks[k]:
            continue
        top = 0
        stack[0, 0], stack[0, 1] = start, k
        while top >= 0:
            a, b = stack[top, 0], stack[top, 1]
            top -= 1
            where, d = (a, 0.0)
            if b - a >= 2:
                where, d = farthest_from_chord(xy, a, b)
            if d > threshold and top < 60:
                # Right half first onto the stack: runs come out in scanning order.
                top += 1
                stack[top, 0], stack[top, 1] = where, b
                top += 1
                stack[top, 0], stack[top, 1] = a, where
            else:
                runs[count, 0], runs[count, 1], runs[count, 2] = a, b, cluster
                count += 1
        cluster += 1
        start = k + 1
    return count


@kernel
def prefix_moments(xy):  # type: ignore[no-untyped-def]
    """Running sums of x, y, xx, xy, yy: the moments of any run of points in constant time."""
    n = xy.shape[0]
    s = np.zeros((n + 1, 5))
    for k in range(n):
        x, y = xy[k, 0], xy[k, 1]
        s[k + 1, 0] = s[k, 0] + x
        s[k + 1, 1] = s[k, 1] + y
        s[k + 1, 2] = s[k, 2] + x * x
        s[k + 1, 3] = s[k, 3] + x * y
        s[k + 1, 4] = s[k, 4] + y * y
    return s


@kernel
def fit_run(xy, s, a, b):  # type: ignore[no-untyped-def]
    """Total least squares over points a..b: centroid, direction a -> b, spread across, along."""
    m = b - a + 1
    mx, my = (s[b + 1, 0] - s[a, 0]) / m, (s[b + 1, 1] - s[a, 1]) / m
    sxx = (s[b + 1, 2] - s[a, 2]) - m * mx * mx
    sxy = (s[b + 1, 3] - s[a, 3]) - m * mx * my
    syy = (s[b + 1, 4] - s[a, 4]) - m * my * my
    theta = 0.5 * math.atan2(2.0 * sxy, sxx - syy)
    ux, uy = math.cos(theta), math.sin(theta)
    if ux * (xy[b, 0] - xy[a, 0]) + uy * (xy[b, 1] - xy[a, 1]) < 0.0:
        ux, uy = -ux, -uy
    along = ux * ux * sxx + 2.0 * ux * uy * sxy + uy * uy * syy
    across = max(uy * uy * sxx - 2.0 * ux * uy * sxy + ux * ux * syy, 0.0)
    return mx, my, ux, uy, across, along


@kernel
def max_deviation(xy, a, b, mx, my, ux, uy):  # type: ignore[no-untyped-def]
    """Largest distance of points a..b from the line through (mx, my) along (ux, uy)."""
    worst = 0.0
    for k in range(a, b + 1):
        d = abs(ux * (xy[k, 1] - my) - uy * (xy[k, 0] - mx))
        worst = max(worst, d)
    return worst


@kernel
def merge_runs(xy, s, runs, count, limit, min_points, max_gap):  # type: ignore[no-untyped-def]
    """Algorithm 1, the merge: join neighbours that lie on one line and leave no gap between."""
    if count == 0:
        return 0
    out = 0
    for q in range(1, count):
        a, b = runs[out, 0], runs[q, 1]
        joined = False
        big_enough = runs[out, 1] - runs[out, 0] + 1 >= 3 or runs[q, 1] - runs[q, 0] + 1 >= 3
        i, j = runs[out, 1], runs[q, 0]
        adjacent = runs[out, 2] == runs[q, 2]
        if not adjacent:
            adjacent = (xy[i, 0] - xy[j, 0]) ** 2 + (xy[i, 1] - xy[j, 1]) ** 2 < max_gap * max_gap
        if adjacent and big_enough and b - a + 1 >= min_points:
            mx, my, ux, uy, _across, _along = fit_run(xy, s, a, b)
            if max_deviation(xy, a, b, mx, my, ux, uy) < limit:
                runs[out, 1] = b
                joined = True
        if not joined:
            out += 1
            runs[out, 0], runs[out, 1], runs[out, 2] = runs[q, 0], runs[q, 1], runs[q, 2]
    return out + 1


@kernel
def fit_lines(xy, s, beam, runs, count, sigma, min_points, min_length):  # type: ignore[no-untyped-def]
    """Rows of LINE_COLUMNS for the runs that are long and full enough; oriented, free side left."""
    lines = np.empty((count, LINE_COLUMNS))
    m = 0
    for q in range(count):
        a, b = runs[q, 0], runs[q, 1]
        # A split point belongs to both neighbours; trimming it keeps corners from bending lines.
        if b - a + 1 > min_points + 1:
            if q > 0 and runs[q - 1, 1] == a:
                a += 1
            if q + 1 < count and runs[q + 1, 0] == b:
                b -= 1
        if b - a + 1 < min_points:
            continue
        mx, my, ux, uy, across, along = fit_run(xy, s, a, b)
        ta = ux * (xy[a, 0] - mx) + uy * (xy[a, 1] - my)
        tb = ux * (xy[b, 0] - mx) + uy * (xy[b, 1] - my)
        if tb - ta < min_length:
            continue
        # Free side left means the sensor is left of the line: anything else is a fold of noise.
        if ux * (0.0 - my) - uy * (0.0 - mx) <= 0.0:
            continue
        n = b - a + 1
        var = max(across / max(n - 2, 1), sigma * sigma)
        lines[m, X1], lines[m, Y1] = mx + ta * ux, my + ta * uy
        lines[m, X2], lines[m, Y2] = mx + tb * ux, my + tb * uy
        lines[m, THETA] = math.atan2(uy, ux)
        lines[m, OFFSET] = ux * my - uy * mx
        lines[m, LENGTH] = tb - ta
        lines[m, VAR_THETA] = var / max(along, 1e-9)
        lines[m, VAR_OFFSET] = var / n
        lines[m, COUNT] = n
        lines[m, FIRST] = beam[a]
        lines[m, LAST] = beam[b]
        m += 1
    return lines[:m]


@kernel
def line_range_at(line, angle):  # type: ignore[no-untyped-def]
    """Range at which a beam at `angle` meets the infinite line; inf where it does not."""
    # n . (r c, r s) = offset with n the left normal.
    denominator = -math.sin(line[THETA]) * math.cos(angle) + math.cos(line[THETA]) * math.sin(angle)
    if abs(denominator) < 1e-6:
        return np.inf
    r = line[OFFSET] / denominator
    return r if r > 0.0 else np.inf


@kernel
def intersect(p, q):  # type: ignore[no-untyped-def]
    """Intersection of two infinite lines and the sine between them (0 where parallel)."""
    sp, cp = math.sin(p[THETA]), math.cos(p[THETA])
    sq, cq = math.sin(q[THETA]), math.cos(q[THETA])
    sine = cp * sq - sp * cq
    if abs(sine) < 1e-9:
        return 0.0, 0.0, 0.0
    # -sp x + cp y = op ; -sq x + cq y = oq
    x = (cq * p[OFFSET] - cp * q[OFFSET]) / sine
    y = (sq * p[OFFSET] - sp * q[OFFSET]) / sine
    return x, y, sine


@kernel
def classify_ends(lines, ranges, angle_min, angle_increment, sigma, full_turn, corner_reach):  # type: ignore[no-untyped-def]
    """End types (n, 2) and edge points (n, 2, 2), §3.2-3.3: angle edges and jump edges.

    An end at the field of view's border is interior; beside a beam without return it is unknown.
    """
    n = lines.shape[0]
    beams = ranges.shape[0]
    ends = np.zeros((n, 2), dtype=np.int64)
    points = np.empty((n, 2, 2))
    for i in range(n):
        for side in range(2):
            px = lines[i, X1] if side == 0 else lines[i, X2]
            py = lines[i, Y1] if side == 0 else lines[i, Y2]
            points[i, side, 0], points[i, side, 1] = px, py
            step = -1 if side == 0 else 1
            last = int(lines[i, FIRST]) if side == 0 else int(lines[i, LAST])
            # Angle edge: two neighbouring lines whose intersection lies between their end beams.
            j = i + step
            if full_turn:
                j = (j + n) % n
            if 0 <= j < n and j != i:
                other = int(lines[j, LAST]) if side == 0 else int(lines[j, FIRST])
                gap = (other - last) * step
                if full_turn and gap < 0:
                    gap += beams
                if 0 <= gap <= 3:
                    ix, iy, sine = intersect(lines[i], lines[j])
                    ox = lines[j, X2] if side == 0 else lines[j, X1]
                    oy = lines[j, Y2] if side == 0 else lines[j, Y1]
                    near = math.hypot(ix - px, iy - py) < corner_reach
                    near_other = math.hypot(ix - ox, iy - oy) < corner_reach
                    if abs(sine) > 0.17 and near and near_other:
                        bearing = (math.atan2(iy, ix) - angle_min) / angle_increment
                        span = 2.0 * math.pi / angle_increment
                        rel = (bearing - last) * step
                        rel -= span * math.floor((rel + 0.5 * span) / span)
                        if -1.5 <= rel <= gap + 1.5:
                            ends[i, side] = EDGE
                            points[i, side, 0], points[i, side, 1] = ix, iy
                            continue
            k = last + step
            if full_turn:
                k = (k + beams) % beams
            if k < 0 or k >= beams:
                continue  # border of the field of view: interior
            r = ranges[k]
            if not math.isfinite(r):
                ends[i, side] = UNKNOWN
                continue
            predicted = line_range_at(lines[i], angle_min + k * angle_increment)
            margin = 3.0 * sigma + 0.05 + 0.005 * r
            if math.isfinite(predicted) and r > predicted + margin:
                ends[i, side] = EDGE  # jump edge: the surface ends, the beam goes on
    return ends, points


@kernel
def extract(  # type: ignore[no-untyped-def]
    ranges,
    angle_min,
    angle_increment,
    sigma,
    lam,
    split,
    merge_factor,
    min_points,
    min_length,
    max_gap_beams,
    max_gap,
    corner_reach,
):
    """All steps of §3 in one call: points, beams, chain ends, lines, end types, edge points."""
    xy, beam = to_points(ranges, angle_min, angle_increment)
    order, breaks = cluster_points(xy, beam, ranges, angle_increment, lam, sigma, max_gap_beams)
    xy, beam = xy[order], beam[order]
    runs = np.empty((xy.shape[0] + 2, 3), dtype=np.int64)
    count = split_clusters(xy, breaks, split, runs)
    moments = prefix_moments(xy)
    count = merge_runs(xy, moments, runs, count, merge_factor * split, min_points, max_gap)
    lines = fit_lines(xy, moments, beam, runs, count, sigma, min_points, min_length)
    full_turn = ranges.shape[0] * angle_increment > 2.0 * math.pi - 1.5 * angle_increment
    ends, edges = classify_ends(
        lines, ranges, angle_min, angle_increment, sigma, full_turn, corner_reach
    )
    return xy, beam, breaks, lines, ends, edges


@kernel
def point_normals(xy, breaks, reach):  # type: ignore[no-untyped-def]
    """Unit normals towards the sensor from up to `reach` chain neighbours a side; zeros where none.

    A point whose neighbourhood is not a line (spread across more than a tenth of that along) has
    no normal.
    """
    n = xy.shape[0]
    out = np.zeros((n, 2))
    first = 0
    for last in range(n):
        if not breaks[last]:
            continue
        for k in range(first, last + 1):
            a, b = max(first, k - reach), min(last, k + reach)
            m = b - a + 1
            if m < 3:
                continue
            mx = my = 0.0
            for q in range(a, b + 1):
                mx += xy[q, 0]
                my += xy[q, 1]
            mx /= m
            my /= m
            sxx = sxy = syy = 0.0
            for q in range(a, b + 1):
                dx, dy = xy[q, 0] - mx, xy[q, 1] - my
                sxx += dx * dx
                sxy += dx * dy
                syy += dy * dy
            half = 0.5 * (sxx + syy)
            root = math.sqrt(0.25 * (sxx - syy) ** 2 + sxy * sxy)
            if root <= 0.0 or (half - root) > 0.1 * (half + root):
                continue
            theta = 0.5 * math.atan2(2.0 * sxy, sxx - syy)
            nx, ny = -math.sin(theta), math.cos(theta)
            if nx * xy[k, 0] + ny * xy[k, 1] > 0.0:
                nx, ny = -nx, -ny
            out[k, 0], out[k, 1] = nx, ny
        first = last + 1
    return out
