"""An occupancy grid: free where beams passed, occupied where they ended or a line lies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.fusion import _occupancy_kernels as _kernels
from lineloom_core.geometry import Pose

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
"""Values of a cell, as in `nav_msgs/OccupancyGrid`."""

DEFAULT_RESOLUTION_M = 0.05
MOST_CELLS = 64_000_000

_MARGIN_CELLS = 4
_BAND_ROWS = 256
"""Worked out at a time: shares of a whole grid at once took 30 bytes a cell."""
_SHARE_OCCUPIED = 0.35
"""A cell where at least this share of the beams that met it ended is occupied."""


class GridTooLargeError(ValueError):
    """The map would take more cells than anybody can use; the text says what would do."""


@storable("rays")
@dataclass(frozen=True, eq=False)
class Rays:
    """Scans as rays: k lasers, n beams in all.

    poses (k, 3): x, y, theta in one frame [m, rad]. sweeps (k, 2): angle_min and angle_increment.
    starts (k + 1,): scan i owns ranges[starts[i] : starts[i + 1]]. ranges (n,) [m]; not finite =
    says nothing.
    """

    poses: NDArray[np.float64]
    sweeps: NDArray[np.float64]
    starts: NDArray[np.int64]
    ranges: NDArray[np.float64]

    @staticmethod
    def of(
        poses: Sequence[NDArray[np.float64]],
        sweeps: Sequence[tuple[float, float]],
        ranges: Sequence[NDArray[np.float64]],
    ) -> Rays:
        """Put scans together: per scan its pose (3,), (angle_min, increment), ranges."""
        counts = [len(r) for r in ranges]
        return Rays(
            poses=np.array(poses, dtype=np.float64).reshape(-1, 3),
            sweeps=np.array(sweeps, dtype=np.float64).reshape(-1, 2),
            starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            ranges=np.concatenate(ranges) if len(ranges) else np.empty(0),
        )

    def moved(self, T_new_old: Pose) -> Rays:
        """Return the same rays in another frame."""
        points, angles = T_new_old.transform(self.poses[:, :2]), self.poses[:, 2] + T_new_old.theta
        return replace(self, poses=np.column_stack([points, angles]))

    def ends(self) -> NDArray[np.float64]:
        """Return where the beams with a finite return end, shape (m, 2) [m]."""
        scan = np.repeat(np.arange(len(self.poses)), np.diff(self.starts))
        beam = np.arange(len(self.ranges)) - self.starts[scan]
        angle = self.poses[scan, 2] + self.sweeps[scan, 0] + self.sweeps[scan, 1] * beam
        finite = np.isfinite(self.ranges)
        r = np.where(finite, self.ranges, 0.0)
        x = self.poses[scan, 0] + r * np.cos(angle)
        y = self.poses[scan, 1] + r * np.sin(angle)
        return np.column_stack([x, y])[finite]


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """cells (rows, columns) int8: FREE, OCCUPIED or UNKNOWN.

    Row 0 is the lowest: the cell at row i, column j covers the square of side `resolution` [m]
    whose lower left corner is (x + j * resolution, y + i * resolution) in the map's frame.
    """

    cells: NDArray[np.int8]
    x: float
    y: float
    resolution: float

    def at(self, x: float, y: float) -> int:
        """Return the value at a point of the map; UNKNOWN outside the grid."""
        i = math.floor((y - self.y) / self.resolution)
        j = math.floor((x - self.x) / self.resolution)
        rows, columns = self.cells.shape
        return int(self.cells[i, j]) if 0 <= i < rows and 0 <= j < columns else UNKNOWN


def rasterise(
    rays: Rays,
    lines: NDArray[np.float64],
    resolution: float = DEFAULT_RESOLUTION_M,
    bbox: tuple[float, float, float, float] | None = None,
) -> OccupancyGrid:
    """Draw rays and lines into a grid that holds them all, or covers the bbox.

    lines: (m, 4) x1, y1, x2, y2 [m], occupied whatever the beams say: they are what many scans
    agreed on. The origin is a multiple of the resolution, so that grids of the same map fit onto
    each other. Raises GridTooLargeError, ValueError for a resolution that is none.
    """
    if not (math.isfinite(resolution) and resolution > 0.0):
        raise ValueError("resolution must be a positive number of metres")
    x, y, columns, rows = _frame(rays, lines, resolution, bbox)
    hits = np.zeros((rows, columns), dtype=np.uint16)
    passes = np.zeros_like(hits)
    _kernels.cast(rays.poses, rays.sweeps, rays.starts, rays.ranges, x, y, resolution, hits, passes)
    cells = np.empty((rows, columns), dtype=np.int8)
    for band in (slice(i, i + _BAND_ROWS) for i in range(0, rows, _BAND_ROWS)):
        met = hits[band].astype(np.float64) + passes[band]
        cells[band] = np.where(met > 0, FREE, UNKNOWN)
        cells[band][(hits[band] > 0) & (hits[band] >= _SHARE_OCCUPIED * met)] = OCCUPIED
    walls = hits
    walls[:] = 0
    for x1, y1, x2, y2 in lines.tolist():
        _kernels.walk(
            walls, (x1 - x) / resolution, (y1 - y) / resolution,
            (x2 - x) / resolution, (y2 - y) / resolution,
        )  # fmt: skip
    cells[walls > 0] = OCCUPIED
    return OccupancyGrid(cells, x, y, resolution)


def _frame(
    rays: Rays,
    lines: NDArray[np.float64],
    resolution: float,
    bbox: tuple[float, float, float, float] | None,
) -> tuple[float, float, int, int]:
    """Return the lower left corner, and the numbers of columns and rows."""
    if bbox is None:
        points = np.vstack([rays.ends(), rays.poses[:, :2], lines.reshape(-1, 2)])
        if len(points) == 0:
            points = np.zeros((1, 2))
        low, high = points.min(axis=0), points.max(axis=0)
        margin = _MARGIN_CELLS
    else:
        low, high, margin = np.array(bbox[:2]), np.array(bbox[2:]), 0
    first = np.floor(low / resolution + 1e-9) - margin
    last = np.ceil(high / resolution - 1e-9) + margin
    columns, rows = (float(v) for v in np.maximum(last - first, 1.0))
    if columns * rows > MOST_CELLS:
        fitting = resolution * math.sqrt(columns * rows / MOST_CELLS)
        raise GridTooLargeError(
            f"the grid would have {columns * rows:.3g} cells at {resolution:g} m; from "
            f"{math.ceil(fitting * 1000) / 1000:g} m on it fits, or ask for a part with bbox"
        )
    return float(first[0] * resolution), float(first[1] * resolution), int(columns), int(rows)
