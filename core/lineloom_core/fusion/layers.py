"""What a line of the map is: a wall, a piece of furniture, or clutter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.layer import Layer

WALL_FROM_M = 1.0
"""Walls have so much in one line, openings left out; what has less is furniture."""

LEAST_ALONE_M = 0.4
"""Shorter pieces that meet nothing else are clutter: chair legs, noise."""


def layers_of(
    lines: NDArray[np.float64],
    wall: NDArray[np.int64],
    once: NDArray[np.bool_],
    met: NDArray[np.bool_],
) -> list[Layer]:
    """Return the layer of each line (m, 4).

    wall (m,): lines with the same number lie on one wall. once (m,): a single keyframe saw it.
    met (m, 2): whether its ends are in corners.
    """
    length = np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1])
    clutter = once | ((length < LEAST_ALONE_M) & ~met.any(axis=1))
    total = np.bincount(wall, length * ~clutter)[wall]
    return [
        "clutter" if c else "wall" if t >= WALL_FROM_M else "furniture"
        for c, t in zip(clutter.tolist(), total.tolist(), strict=True)
    ]
