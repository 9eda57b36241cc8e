"""Walls sorted into a grid of square cells, so that a beam only meets the walls near its way."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lineloom_lab.simulation import _kernels

_CELL_M = 0.5
_MAX_CELLS_PER_SIDE = 1000


@dataclass(frozen=True, eq=False)
class WallGrid:
    """A regular grid over walls of shape (n, 4) [m]; built once per world.

    origin: lower left corner of cell (0, 0) [m]. cell: side of a cell [m]. starts, members: the
    walls of each cell, see `_kernels`.
    """

    walls: NDArray[np.float64]
    origin: tuple[float, float]
    cell: float
    columns: int
    rows: int
    starts: NDArray[np.int64]
    members: NDArray[np.int64]

    @staticmethod
    def of(walls: NDArray[np.float64]) -> WallGrid:
        """Sort walls of shape (n, 4) [m] into a grid that covers them all."""
        if len(walls) == 0:
            empty = np.zeros(2, dtype=np.int64)
            return WallGrid(walls, (0.0, 0.0), _CELL_M, 1, 1, empty, np.empty(0, dtype=np.int64))
        low_x, high_x = float(walls[:, [0, 2]].min()), float(walls[:, [0, 2]].max())
        low_y, high_y = float(walls[:, [1, 3]].min()), float(walls[:, [1, 3]].max())
        # A large world gets larger cells: memory stays bounded.
        cell = max(_CELL_M, max(high_x - low_x, high_y - low_y) / _MAX_CELLS_PER_SIDE)
        # Half a cell of margin on every side keeps walls on the border inside.
        origin = (low_x - 0.5 * cell, low_y - 0.5 * cell)
        columns = math.floor((high_x - origin[0]) / cell + 0.5) + 1
        rows = math.floor((high_y - origin[1]) / cell + 0.5) + 1
        starts, members = _kernels.grid_walls(walls, *origin, cell, columns, rows)
        return WallGrid(walls, origin, cell, columns, rows, starts, members)

    def cast(
        self, x: float, y: float, directions: ArrayLike, limit: float = math.inf
    ) -> NDArray[np.float64]:
        """Return exact distances [m] from (x, y) along directions of shape (n,) [rad].

        +inf where no wall is met within `limit` [m].
        """
        beams = np.ascontiguousarray(directions, dtype=np.float64)
        ranges: NDArray[np.float64] = _kernels.cast_beams(
            self.walls,
            self.starts,
            self.members,
            *self.origin,
            self.cell,
            self.columns,
            self.rows,
            float(x),
            float(y),
            beams,
            float(limit),
        )
        return ranges

    def surfaces(
        self, x: float, y: float, directions: ArrayLike, limit: float, piece: float
    ) -> NDArray[np.int64]:
        """Return what each beam of shape (n,) [rad] ends on: rows wall, piece of it, side, (n, 3).

        Pieces are `piece` [m] long. Wall -1 where none is met within `limit` [m].
        """
        beams = np.ascontiguousarray(directions, dtype=np.float64)
        seen: NDArray[np.int64] = _kernels.seen_surfaces(
            self.walls,
            self.starts,
            self.members,
            *self.origin,
            self.cell,
            self.columns,
            self.rows,
            float(x),
            float(y),
            beams,
            float(limit),
            float(piece),
        )
        return seen
