"""Numba kernels of the local map. Slow twins: tests/core/matching/slow_twins.py.

A local map is a grid of nx x ny cells of CELL metres with a corner at (ox, oy): `index` holds the
row of `surface` in each cell or -1; a row of `surface` is mean x, mean y, normal x, normal y and
weight. `field` is the same grid with 255 on a surface and less beside it.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.features._kernels import FIRST, LAST, OFFSET, THETA
from lineloom_core.kernels import kernel

CELL = 0.1
ON_LINE = 0.06


@kernel
def line_normals(points, beams, lines, normals):  # type: ignore[no-untyped-def]
    """Give the points of a line segment the line's normal: a wall seen by many beams is straight.

    Normals from a few neighbours wobble, and what wobbles seems to observe the position along a
    plain wall.
    """
    for i in range(lines.shape[0]):
        nx, ny = -math.sin(lines[i, THETA]), math.cos(lines[i, THETA])
        for k in range(points.shape[0]):
            if lines[i, FIRST] <= beams[k] <= lines[i, LAST]:
                off = nx * points[k, 0] + ny * points[k, 1] - lines[i, OFFSET]
                if abs(off) < ON_LINE:
                    normals[k, 0], normals[k, 1] = nx, ny


@kernel
def bounds(points, kept, pose, reach, box):  # type: ignore[no-untyped-def]
    """Widen box (min x, min y, max x, max y) by the kept points within `reach` of the laser."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(points.shape[0]):
        px, py = points[k, 0], points[k, 1]
        if not kept[k] or px * px + py * py > reach * reach:
            continue
        x, y = c * px - s * py + pose[0], s * px + c * py + pose[1]
        box[0], box[1] = min(box[0], x), min(box[1], y)
        box[2], box[3] = max(box[2], x), max(box[3], y)


@kernel
def insert_points(  # type: ignore[no-untyped-def]
    index, surface, used, ox, oy, points, normals, kept, pose, reach
):
    """Add the kept points (laser frame at `pose`) to the cells; returns the number of rows in use.

    A cell keeps the mean of the points whose normals agree with the first one's.
    """
    nx_cells, ny_cells = index.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(points.shape[0]):
        px, py = points[k, 0], points[k, 1]
        if not kept[k] or px * px + py * py > reach * reach:
            continue
        x, y = c * px - s * py + pose[0], s * px + c * py + pose[1]
        gx, gy = math.floor((x - ox) / CELL), math.floor((y - oy) / CELL)
        if gx < 0 or gy < 0 or gx >= nx_cells or gy >= ny_cells:
            continue
        nx = c * normals[k, 0] - s * normals[k, 1]
        ny = s * normals[k, 0] + c * normals[k, 1]
        has_normal = nx != 0.0 or ny != 0.0
        row = index[gx, gy]
        if row < 0:
            if used >= surface.shape[0]:
                continue
            index[gx, gy] = used
            surface[used, 0], surface[used, 1] = x, y
            surface[used, 2], surface[used, 3] = nx, ny
            surface[used, 4] = 1.0
            used += 1
            continue
        w = surface[row, 4]
        known = surface[row, 2] != 0.0 or surface[row, 3] != 0.0
        if known and has_normal:
            if surface[row, 2] * nx + surface[row, 3] * ny < 0.7:
                continue
        elif known != has_normal:
            if known:
                continue
            # The first point with a normal replaces those without.
            surface[row, 0], surface[row, 1] = x, y
            surface[row, 2], surface[row, 3] = nx, ny
            surface[row, 4] = 1.0
            continue
        surface[row, 0] += (x - surface[row, 0]) / (w + 1.0)
        surface[row, 1] += (y - surface[row, 1]) / (w + 1.0)
        if has_normal:
            mx = surface[row, 2] * w + nx
            my = surface[row, 3] * w + ny
            norm = math.hypot(mx, my)
            surface[row, 2], surface[row, 3] = mx / norm, my / norm
        surface[row, 4] = min(w + 1.0, 20.0)
    return used


@kernel
def fill_field(field, surface, used, ox, oy):  # type: ignore[no-untyped-def]
    """Stamp every surface cell into the likelihood field: 255 on it, falling to 0 at 0.3 m."""
    nx_cells, ny_cells = field.shape
    stamp = np.empty((5, 5), dtype=np.uint8)
    for a in range(5):
        for b in range(5):
            d = math.hypot(a - 2, b - 2) * CELL
            stamp[a, b] = int(255.0 * math.exp(-0.5 * (d / 0.12) ** 2))
    for row in range(used):
        gx = math.floor((surface[row, 0] - ox) / CELL)
        gy = math.floor((surface[row, 1] - oy) / CELL)
        for a in range(max(gx - 2, 0), min(gx + 3, nx_cells)):
            for b in range(max(gy - 2, 0), min(gy + 3, ny_cells)):
                field[a, b] = max(field[a, b], stamp[a - gx + 2, b - gy + 2])


@kernel
def build(points, normals, kept, begins, poses, reach, searchable):  # type: ignore[no-untyped-def]
    """Merge clouds, first come first served; returns index, surface, field, ox, oy.

    points, normals (n, 2): of all, one after the other, those `kept` (n,); begins (k + 1,): where
    each cloud's begin; poses (k, 3). Without `searchable` the field stays empty.
    """
    box = np.array([np.inf, np.inf, -np.inf, -np.inf])
    for q in range(poses.shape[0]):
        of = slice(begins[q], begins[q + 1])
        bounds(points[of], kept[of], poses[q], reach, box)
    if not np.all(np.isfinite(box)):
        box[:] = 0.0
    margin = 3.5 * CELL  # the outermost points, too, lie amid their cells
    ox, oy = box[0] - margin, box[1] - margin
    nx = math.ceil((box[2] + margin - ox) / CELL)
    ny = math.ceil((box[3] + margin - oy) / CELL)
    index = np.full((nx, ny), np.int32(-1))
    surface = np.empty((points.shape[0] + 1, 5))
    used = 0
    for q in range(poses.shape[0]):
        of = slice(begins[q], begins[q + 1])
        used = insert_points(
            index, surface, used, ox, oy, points[of], normals[of], kept[of], poses[q], reach
        )
    field = np.zeros((nx, ny) if searchable else (0, 0), dtype=np.uint8)
    if searchable:
        fill_field(field, surface, used, ox, oy)
    return index, surface[:used].copy(), field, ox, oy


@kernel
def thin(points, spacing, most):  # type: ignore[no-untyped-def]
    """Rows at least `spacing` from the one kept before; of those every k-th, up to `most`."""
    n = points.shape[0]
    keep = np.empty(n, dtype=np.int64)
    m = 0
    for k in range(n):
        if m > 0:
            dx = points[k, 0] - points[keep[m - 1], 0]
            dy = points[k, 1] - points[keep[m - 1], 1]
            if dx * dx + dy * dy < spacing * spacing:
                continue
        keep[m] = k
        m += 1
    step = max(1, (m + most - 1) // most)
    return keep[:m:step]


@kernel
def field_score(field, ox, oy, px, py, c, s, tx, ty):  # type: ignore[no-untyped-def]
    """Sum of the field over points rotated by (c, s) and moved by (tx, ty)."""
    nx_cells, ny_cells = field.shape
    total = 0
    inv = 1.0 / CELL
    bx, by = (tx - ox) * inv, (ty - oy) * inv
    for k in range(px.shape[0]):
        gx = int(bx + (c * px[k] - s * py[k]) * inv)
        gy = int(by + (s * px[k] + c * py[k]) * inv)
        if 0 <= gx < nx_cells and 0 <= gy < ny_cells:
            total += field[gx, gy]
    return total


@kernel
def correlate(field, ox, oy, points, guess, reach_xy, reach_theta, step_xy, step_theta, pull):  # type: ignore[no-untyped-def]
    """Best pose in a window around `guess` by exhaustive search; returns x, y, theta, score.

    score is the mean field value (0..1) less `pull` times the squared distance from the guess in
    units of the window, so that where nothing is observed the guess stands.
    """
    n = points.shape[0]
    px, py = points[:, 0].copy(), points[:, 1].copy()
    kt = math.ceil(reach_theta / step_theta)
    kx = math.ceil(reach_xy / step_xy)
    best = np.array([guess[0], guess[1], guess[2], -1e9])
    if n == 0:
        return best
    scale = 1.0 / (255.0 * n)
    for t in range(-kt, kt + 1):
        theta = guess[2] + t * step_theta
        c, s = math.cos(theta), math.sin(theta)
        qt = (t * step_theta / reach_theta) ** 2
        for a in range(-kx, kx + 1):
            for b in range(-kx, kx + 1):
                q = qt + (a * a + b * b) * (step_xy / reach_xy) ** 2
                x, y = guess[0] + a * step_xy, guess[1] + b * step_xy
                v = field_score(field, ox, oy, px, py, c, s, x, y) * scale - pull * q
                if v > best[3]:
                    best[0], best[1], best[2], best[3] = x, y, theta, v
    return best


@kernel
def register(  # type: ignore[no-untyped-def]
    index, surface, ox, oy, points, normals, weights, guess, prior, gate, sigma, iterations
):
    """Point-to-line registration (Gauss-Newton, Cauchy weights) of points against a local map.

    prior: diagonal information that holds the pose at `guess` (laser axes do not matter: x, y,
    theta of the map frame). Returns pose (3,), H (3, 3) at the end without the prior, and
    (matched weight, total weight inside the grid, rms of matched residuals).
    """
    nx_cells, ny_cells = index.shape
    pose = guess.copy()
    H = np.zeros((3, 3))
    stats = np.zeros(3)
    reach = gate
    last = iterations
    for it in range(iterations + 1):
        H[:] = 0.0
        g = np.zeros(3)
        matched = total = squares = 0.0
        c, s = math.cos(pose[2]), math.sin(pose[2])
        rings = math.ceil(reach / CELL)
        for k in range(points.shape[0]):
            rx = c * points[k, 0] - s * points[k, 1]
            ry = s * points[k, 0] + c * points[k, 1]
            x, y = rx + pose[0], ry + pose[1]
            gx, gy = math.floor((x - ox) / CELL), math.floor((y - oy) / CELL)
            if gx < 0 or gy < 0 or gx >= nx_cells or gy >= ny_cells:
                continue
            total += weights[k]
            nx = c * normals[k, 0] - s * normals[k, 1]
            ny = s * normals[k, 0] + c * normals[k, 1]
            has_normal = nx != 0.0 or ny != 0.0
            best, where = reach * reach, -1
            for a in range(max(gx - rings, 0), min(gx + rings + 1, nx_cells)):
                for b in range(max(gy - rings, 0), min(gy + rings + 1, ny_cells)):
                    row = index[a, b]
                    if row < 0:
                        continue
                    known = surface[row, 2] != 0.0 or surface[row, 3] != 0.0
                    facing = surface[row, 2] * nx + surface[row, 3] * ny
                    if has_normal and known and facing < 0.7:
                        continue
                    d2 = (surface[row, 0] - x) ** 2 + (surface[row, 1] - y) ** 2
                    if d2 < best:
                        best, where = d2, row
            if where < 0:
                continue
            ux, uy = surface[where, 2], surface[where, 3]
            if ux == 0.0 and uy == 0.0:
                if not has_normal:
                    continue
                ux, uy = nx, ny
            e = ux * (x - surface[where, 0]) + uy * (y - surface[where, 1])
            w = weights[k] / (sigma * sigma)
            q = e / (3.0 * sigma)
            w /= 1.0 + q * q
            j2 = -ux * ry + uy * rx
            H[0, 0] += w * ux * ux
            H[0, 1] += w * ux * uy
            H[0, 2] += w * ux * j2
            H[1, 1] += w * uy * uy
            H[1, 2] += w * uy * j2
            H[2, 2] += w * j2 * j2
            g[0] -= w * ux * e
            g[1] -= w * uy * e
            g[2] -= w * j2 * e
            if abs(e) < 3.0 * sigma:
                matched += weights[k]
                squares += weights[k] * e * e
        H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
        stats[0], stats[1] = matched, total
        stats[2] = math.sqrt(squares / matched) if matched > 0.0 else np.inf
        if it == last:
            break
        A = H.copy()
        for d in range(3):
            A[d, d] += prior[d] + 1e-9
            g[d] += prior[d] * (guess[d] - pose[d])
        step = np.linalg.solve(A, g)
        pose += step
        reach = max(0.7 * reach, 0.12)
        if abs(step[0]) + abs(step[1]) < 2e-4 and abs(step[2]) < 1e-4 and reach < 0.13:
            last = it + 1  # settled: one more pass for H and the figures at the final pose
    return pose, H, stats
