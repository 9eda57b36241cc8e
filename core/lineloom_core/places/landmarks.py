"""What tells a place where walls do not: columns, pillars, corners; their constellation.

Halls show little wall and many columns. Beyond the thesis, which matches lines alone (its chapter
7 leaves other features to future work).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features._kernels import EDGE, LENGTH, THETA
from lineloom_core.places import _constellation_kernels as _kernels

_GAP, _MOST = 0.45, 2.0  # m: between points of one object; its size
_SAME_CORNER = 0.3  # m
_MOST_LANDMARKS = 48


def find_landmarks(
    points: NDArray[np.float64],
    lines: NDArray[np.float64],
    ends: NDArray[np.int64],
    edges: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The landmarks nearest to a place's anchor, rows as the kernels take them, shape (n, 5).

    points (m, 2); lines, ends and edges as `Place` has them. Of a corner each line counts.
    """
    objects = _kernels.find_objects(points, _GAP, _MOST)
    found = [(x, y, float(_kernels.OBJECT), 1.0, 0.0) for x, y in objects.tolist()]
    for i in np.argsort(-lines[:, LENGTH], kind="stable").tolist():
        for side in range(2):
            x, y = edges[i, side].tolist()
            kind = 1.0 + side
            if ends[i, side] == EDGE and not any(
                k == kind and math.hypot(a - x, b - y) < _SAME_CORNER for a, b, k, *_ in found
            ):
                theta = float(lines[i, THETA])
                found.append((x, y, kind, math.cos(theta), math.sin(theta)))
    rows = np.array(found).reshape(-1, 5)
    away = np.hypot(rows[:, 0], rows[:, 1])
    nearest = np.argsort(away, kind="stable")[:_MOST_LANDMARKS]
    return np.ascontiguousarray(rows[nearest])
