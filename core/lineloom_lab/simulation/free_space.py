"""Where a robot can stand and get to: the part of a world one connected floor belongs to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from lineloom_core.geometry import Pose
from numpy.typing import NDArray
from scipy import ndimage

from lineloom_lab.simulation import _kernels
from lineloom_lab.simulation.world import World

_CLEARANCE_CAP_M = 0.8
_INDOOR_BEAMS = 16
_INDOOR_SHARE = 0.85


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """A grid over a world, marking the largest connected piece of floor indoors.

    origin: lower left corner of cell (0, 0) [m]. cell: side of a cell [m]. clearance: distance of
    each cell's centre to the nearest solid segment [m], at most 0.8, shape (rows, columns).
    reachable: where a robot of `radius` [m] can stand, all mutually connected, same shape.
    """

    world: World
    radius: float
    origin: tuple[float, float]
    cell: float
    clearance: NDArray[np.float64]
    reachable: NDArray[np.bool_]

    @staticmethod
    def of(world: World, radius: float = 0.25, cell: float = 0.1) -> FreeSpace:
        """Survey a world for a robot of `radius` [m].

        The outside of a building is free too, so floor only counts where nearly all horizontal
        directions end at a wall. Raises ValueError where no cell remains.
        """
        x0, y0, x1, y1 = world.bounds
        columns, rows = math.ceil((x1 - x0) / cell) + 1, math.ceil((y1 - y0) / cell) + 1
        cap = max(_CLEARANCE_CAP_M, radius + cell)
        clearance = _kernels.clearance_map(world.solid, x0, y0, cell, columns, rows, cap)
        # A path between neighbouring centres strays from them by at most half a cell's diagonal.
        standing = clearance >= radius + cell * math.sqrt(0.5)
        standing &= _indoors(world, standing, (x0, y0), cell)
        labels, count = ndimage.label(standing)
        if count == 0:
            raise ValueError(
                f"world {world.name!r} has no room indoors for a robot of radius {radius} m"
            )
        largest = int(np.argmax(np.bincount(labels.ravel())[1:])) + 1
        return FreeSpace(world, radius, (x0, y0), cell, clearance, labels == largest)

    @cached_property
    def cells(self) -> NDArray[np.int64]:
        """All reachable cells, shape (n, 2), rows row, column."""
        return np.argwhere(self.reachable)

    @property
    def area(self) -> float:
        """Size of the reachable floor [m^2]."""
        return float(self.reachable.sum()) * self.cell**2

    def centre(self, row: int, column: int) -> tuple[float, float]:
        """Return the centre of a cell [m]."""
        return (
            self.origin[0] + (column + 0.5) * self.cell,
            self.origin[1] + (row + 0.5) * self.cell,
        )

    def nearest_cell(self, x: float, y: float) -> tuple[int, int]:
        """Return (row, column) of the reachable cell nearest to (x, y)."""
        offset = (self.cells[:, ::-1] + 0.5) * self.cell + np.array(self.origin) - (x, y)
        row, column = self.cells[int(np.argmin(np.sum(offset * offset, axis=1)))]
        return int(row), int(column)

    def random_point(self, rng: np.random.Generator) -> tuple[float, float]:
        """Draw a point [m] on the reachable floor, uniform up to the grid."""
        row, column = self.cells[int(rng.integers(len(self.cells)))]
        return self.centre(int(row), int(column))

    def random_pose(self, rng: np.random.Generator) -> Pose:
        """Draw a collision-free pose on the reachable floor, facing anywhere."""
        x, y = self.random_point(rng)
        return Pose(x, y, float(rng.uniform(-math.pi, math.pi)))


def _indoors(
    world: World, standing: NDArray[np.bool_], origin: tuple[float, float], cell: float
) -> NDArray[np.bool_]:
    """Return which cells are surrounded by walls; asked once per 3 x 3 cells to save time."""
    rows, columns = standing.shape
    directions = np.linspace(0.0, math.tau, _INDOOR_BEAMS, endpoint=False) + 0.01
    coarse = np.zeros((math.ceil(rows / 3), math.ceil(columns / 3)), dtype=bool)
    world_solid = World(world.solid, world.name)
    for r in range(coarse.shape[0]):
        for c in range(coarse.shape[1]):
            if not standing[3 * r : 3 * r + 3, 3 * c : 3 * c + 3].any():
                continue
            x, y = origin[0] + (3 * c + 1.5) * cell, origin[1] + (3 * r + 1.5) * cell
            hits = np.isfinite(world_solid.cast(x, y, directions))
            coarse[r, c] = hits.mean() >= _INDOOR_SHARE
    fine: NDArray[np.bool_] = np.kron(coarse, np.ones((3, 3), dtype=bool))[:rows, :columns]
    return fine
