"""Numba kernels of the search for a scan that may be anywhere around, turned in any way.

Slow twins: tests/core/matching/test_wide_search.py.
"""

from __future__ import annotations

import math

import numpy as np

from lineloom_core.kernels import kernel
from lineloom_core.matching._proposal_kernels import wrap_angle
from lineloom_core.matching._registration_kernels import field_score

COARSE = 0.25
"""Pitch [m] of the coarse field and of the positions that are tried in it."""
TURNS = 120
"""Headings that are tried."""
MOST_POINTS = 45
"""Of a scan, which the coarse search looks at."""
SPREAD = 0.22
"""How far [m] a surface reaches in the coarse field: half a pitch, and a turn of half a step."""


@kernel
def coarse_field(surface, ox, oy, nx, ny):  # type: ignore[no-untyped-def]
    """Likelihood field (nx, ny) of COARSE metres a cell, 255 on a surface."""
    field = np.zeros((nx, ny), dtype=np.uint8)
    inv = 1.0 / COARSE
    levels = np.empty(1300, dtype=np.uint8)  # over the squared distance, in hundredths of a cell
    for q in range(levels.shape[0]):
        levels[q] = int(255.0 * math.exp(-0.5 * (q + 0.5) / 100.0 * (COARSE / SPREAD) ** 2))
    for row in range(surface.shape[0]):
        fx, fy = (surface[row, 0] - ox) * inv, (surface[row, 1] - oy) * inv
        gx, gy = math.floor(fx), math.floor(fy)
        for a in range(max(gx - 2, 0), min(gx + 3, nx)):
            for b in range(max(gy - 2, 0), min(gy + 3, ny)):
                d2 = (a + 0.5 - fx) ** 2 + (b + 0.5 - fy) ** 2
                field[a, b] = max(field[a, b], levels[int(100.0 * d2)])
    return field


@kernel
def search_coarsely(field, ox, oy, points, guess, reach, turns, per_turn):  # type: ignore[no-untyped-def]
    """The best positions of each of `turns` headings, all within `reach` m of `guess`.

    Returns rows x, y, theta, mean field value 0..1; `per_turn` for each heading, at least two
    pitches apart. Points count that stay within the field wherever they are moved.
    """
    nx, ny = field.shape
    n = points.shape[0]
    k = math.ceil(reach / COARSE)
    side = 2 * k + 1
    out = np.empty((turns * per_turn, 4))
    sums = np.empty((side, side), dtype=np.int32)
    inv = 1.0 / COARSE
    rows = 0
    for t in range(turns):
        theta = guess[2] + 2.0 * math.pi * t / turns
        c, s = math.cos(theta), math.sin(theta)
        sums[:] = 0
        for q in range(n):
            gx = math.floor((c * points[q, 0] - s * points[q, 1] + guess[0] - ox) * inv) - k
            gy = math.floor((s * points[q, 0] + c * points[q, 1] + guess[1] - oy) * inv) - k
            if gx < 0 or gy < 0 or gx + side > nx or gy + side > ny:
                continue
            for a in range(side):  # slices, which the compiler can add up several at a time
                line, of_field = sums[a], field[gx + a, gy : gy + side]
                for b in range(side):
                    line[b] += of_field[b]
        for _ in range(per_turn):
            where = np.argmax(sums)
            a, b = where // side, where % side
            if sums[a, b] < 0:
                break
            out[rows, 0], out[rows, 1] = guess[0] + (a - k) * COARSE, guess[1] + (b - k) * COARSE
            out[rows, 2], out[rows, 3] = wrap_angle(theta), sums[a, b] / (255.0 * n)
            rows += 1
            sums[max(a - 1, 0) : a + 2, max(b - 1, 0) : b + 2] = -1
    return out[:rows]


@kernel
def polish(field, ox, oy, px, py, row, reach, step, turn, turn_step):  # type: ignore[no-untyped-def]
    """Move a row (x, y, theta, score) to the best spot of the fine field around it."""
    kx, kt = int(reach / step + 0.5), int(turn / turn_step + 0.5)
    x0, y0, theta0 = row[0], row[1], row[2]
    row[3] = -1.0
    scale = 1.0 / (255.0 * px.shape[0])
    for t in range(-kt, kt + 1):
        theta = theta0 + t * turn_step
        c, s = math.cos(theta), math.sin(theta)
        for a in range(-kx, kx + 1):
            for b in range(-kx, kx + 1):
                x, y = x0 + a * step, y0 + b * step
                v = field_score(field, ox, oy, px, py, c, s, x, y) * scale
                if v > row[3]:
                    row[0], row[1], row[2], row[3] = x, y, theta, v


@kernel
def search_widely(coarse, cx, cy, field, ox, oy, points, guess, reach, most):  # type: ignore[no-untyped-def]
    """Coarse to fine: up to `most` rows x, y, theta, score, best first, apart from each other.

    (cx, cy), (ox, oy): the corners of the two fields.
    """
    thinned = points[:: max(1, points.shape[0] // MOST_POINTS)]
    rough = search_coarsely(coarse, cx, cy, thinned, guess, reach, TURNS, 3)
    order = np.argsort(-rough[:, 3], kind="mergesort")
    found = np.empty((2 * most, 4))
    count = 0
    for q in order:
        if count == found.shape[0]:
            break
        near = False
        for j in range(count):
            d = math.hypot(rough[q, 0] - found[j, 0], rough[q, 1] - found[j, 1])
            if d < 0.45 and abs(wrap_angle(rough[q, 2] - found[j, 2])) < math.radians(7.0):
                near = True
                break
        if not near:
            found[count] = rough[q]
            count += 1
    px, py = points[:, 0].copy(), points[:, 1].copy()
    for j in range(count):
        polish(field, ox, oy, px, py, found[j], 0.2, 0.1, math.radians(3.0), math.radians(1.5))
    return found[:count][np.argsort(-found[:count, 3], kind="mergesort")][:most]
