"""Halls whose walls are far: what tells one spot from another are columns."""

from __future__ import annotations

import math

import numpy as np

from lineloom_lab.simulation.world import World

_APART = 3.0  # m: between two columns
_CORNERS = 36  # of what stands for a circle
_LANE = 2.0  # m: either side of the middle, where robots drive


def columned_hall(
    seed: int, *, size: float = 180.0, field: float = 60.0, columns: int = 60, radius: float = 0.15
) -> World:
    """A square hall of `size` [m] around the origin, out of whose walls' sight round columns stand.

    They stand in no order in a field of `field` [m] in its middle, and none in the lane along x
    through that. Raises ValueError where there is no room.
    """
    rng = np.random.default_rng(seed)
    middles: list[tuple[float, float]] = []
    for _ in range(200 * columns):
        x, y = rng.uniform(-0.5 * field, 0.5 * field, 2).tolist()
        near = any(math.hypot(x - a, y - b) < _APART for a, b in middles)
        if not near and abs(y) > _LANE:
            middles.append((x, y))
        if len(middles) == columns:
            break
    else:
        raise ValueError(f"a field of {field:g} m has no room for {columns} columns")
    walls = _polygon(0.0, 0.0, 0.5 * math.sqrt(2.0) * size, 4)
    for x, y in middles:
        walls += _polygon(x, y, radius, _CORNERS)
    return World(np.array(walls), name=f"columned hall {seed}")


def _polygon(x: float, y: float, radius: float, n: int) -> list[tuple[float, ...]]:
    angles = math.pi * (2.0 * np.arange(n) + 1.0) / n
    corners = np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])
    return [tuple(row) for row in np.hstack([corners, np.roll(corners, -1, axis=0)]).tolist()]
