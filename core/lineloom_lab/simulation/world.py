"""A flat world made of wall segments: what a lidar sees and a robot must not touch."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from lineloom_core.geometry import Pose
from numpy.typing import ArrayLike, NDArray

from lineloom_lab.simulation import _kernels
from lineloom_lab.simulation.wall_grid import WallGrid

_MIN_WALL_M = 1e-6


def _no_walls() -> NDArray[np.float64]:
    return np.empty((0, 4))


@dataclass(frozen=True, eq=False)
class World:
    """Wall segments in one world frame, float64, rows x1, y1, x2, y2 [m].

    walls: shape (n, 4), n >= 1; they stop beams and robots. glass: shape (m, 4); beams pass, robots
    do not. Both arrays are copied and made read-only. Raises ValueError for a wrong shape, for
    numbers that are not finite, and for a world without a wall.
    """

    walls: NDArray[np.float64]
    name: str = "world"
    glass: NDArray[np.float64] = field(default_factory=_no_walls)

    def __post_init__(self) -> None:
        object.__setattr__(self, "walls", _checked(self.walls, "walls"))
        object.__setattr__(self, "glass", _checked(self.glass, "glass"))
        if len(self.walls) + len(self.glass) == 0:
            raise ValueError(f"world {self.name!r} has no walls")

    @staticmethod
    def from_text(path: str | Path) -> World:
        """Read a floor plan: one wall per line, `x1, y1, x2, y2` [m], separated by commas.

        Blank lines and what follows a `#` are ignored, as are walls without length (drawings of
        real buildings hold some). Raises ValueError naming file and line for anything else.
        """
        file = Path(path)
        walls = [
            wall
            for number, text in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1)
            if (wall := _parse_wall(text, f"{file}:{number}")) is not None
        ]
        kept = [w for w in walls if math.hypot(w[2] - w[0], w[3] - w[1]) > _MIN_WALL_M]
        if not kept:
            raise ValueError(f"{file}: holds no wall")
        return World(np.array(kept), name=file.stem)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """The smallest upright box around everything solid: x_min, y_min, x_max, y_max [m]."""
        xs, ys = self.solid[:, [0, 2]], self.solid[:, [1, 3]]
        return float(xs.min()), float(ys.min()), float(xs.max()), float(ys.max())

    @cached_property
    def solid(self) -> NDArray[np.float64]:
        """Everything a robot must not touch: walls and glass, shape (n + m, 4) [m]."""
        return _checked(np.vstack([self.walls, self.glass]), "solid")

    @cached_property
    def grid(self) -> WallGrid:
        """The walls that stop beams, sorted for ray casting."""
        return WallGrid.of(self.walls)

    def cast(
        self, x: float, y: float, directions: ArrayLike, limit: float = math.inf
    ) -> NDArray[np.float64]:
        """Return exact distances [m] from (x, y) to the first wall along each direction.

        directions: shape (n,) [rad] in the world frame. +inf where no wall is met within `limit`.
        """
        return self.grid.cast(x, y, directions, limit)

    def clearance(self, x: float, y: float, cap: float = 10.0) -> float:
        """Return the distance from (x, y) to the nearest solid segment [m], at most `cap`."""
        return float(_kernels.move_clearance(self.solid, x, y, x, y, cap))

    def is_free(self, x: float, y: float, radius: float) -> bool:
        """Is a disk of `radius` [m] at (x, y) clear of everything solid?"""
        return self.clearance(x, y, cap=radius) >= radius

    def is_move_free(self, start: ArrayLike, end: ArrayLike, radius: float) -> bool:
        """May a disk of `radius` [m] slide straight from `start` to `end`, shape (2,) each [m]?"""
        (px, py), (qx, qy) = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        return bool(_kernels.move_clearance(self.solid, px, py, qx, qy, radius) >= radius)

    def moved(self, T_new_world: Pose) -> World:
        """Return the same world expressed in another frame."""

        def move(segments: NDArray[np.float64]) -> NDArray[np.float64]:
            return T_new_world.transform(segments.reshape(-1, 2)).reshape(-1, 4)

        return World(move(self.walls), self.name, move(self.glass))

    def with_walls(self, walls: Iterable[ArrayLike], name: str | None = None) -> World:
        """Return this world with more walls, rows x1, y1, x2, y2 [m]."""
        added = np.array([np.asarray(w, dtype=np.float64) for w in walls]).reshape(-1, 4)
        return World(np.vstack([self.walls, added]), name or self.name, self.glass)


def _checked(segments: ArrayLike, what: str) -> NDArray[np.float64]:
    array = np.array(segments, dtype=np.float64, order="C")
    if array.ndim != 2 or array.shape[1] != 4:
        raise ValueError(f"{what} must have shape (n, 4), not {array.shape}")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{what} must be finite numbers")
    array.setflags(write=False)
    return array


def _parse_wall(text: str, where: str) -> tuple[float, float, float, float] | None:
    content = text.split("#", 1)[0].strip()
    if not content:
        return None
    fields = [f.strip() for f in content.split(",")]
    try:
        x1, y1, x2, y2 = (float(f) for f in fields)
    except ValueError:
        raise ValueError(f"{where}: expected four numbers 'x1, y1, x2, y2': {text!r}") from None
    if not all(math.isfinite(v) for v in (x1, y1, x2, y2)):
        raise ValueError(f"{where}: coordinates must be finite: {text!r}")
    return x1, y1, x2, y2
