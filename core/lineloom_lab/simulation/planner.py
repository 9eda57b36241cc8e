"""Collision-free paths: cheapest way over the grid, pulled straight where there is room."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse import csgraph

from lineloom_lab.simulation.free_space import FreeSpace

_COMFORT_M = 0.5
_WALL_PENALTY = 3.0
_SNAP_M = 1.0
_PATIENCE = 15


@dataclass(frozen=True, eq=False)
class Planner:
    """Finds paths on a `FreeSpace`, for a disk of its radius.

    Cells near walls cost more, up to fourfold, so that paths keep `_COMFORT_M` away from walls
    where there is room and still pass through doors.
    """

    space: FreeSpace

    @cached_property
    def _node_of_cell(self) -> NDArray[np.int64]:
        nodes = np.full(self.space.reachable.shape, -1, dtype=np.int64)
        nodes[self.space.cells[:, 0], self.space.cells[:, 1]] = np.arange(len(self.space.cells))
        return nodes

    @cached_property
    def _costs(self) -> sparse.csr_matrix:
        """Cells joined to their neighbours, weighted by length and nearness to walls."""
        space = self.space
        lacking = np.clip(1.0 - (space.clearance - space.radius) / _COMFORT_M, 0.0, 1.0)
        return self._join(1.0 + _WALL_PENALTY * lacking**2)

    def _join(self, cost: NDArray[np.float64]) -> sparse.csr_matrix:
        """Join cells to their eight neighbours by the length of the step times the mean cost."""
        nodes, space = self._node_of_cell, self.space
        rows, columns = nodes.shape
        sources, targets, weights = [], [], []
        for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = (slice(0, rows - dr), slice(max(0, -dc), columns - max(0, dc)))
            there = (slice(dr, rows), slice(max(0, dc), columns - max(0, -dc)))
            both = (nodes[here] >= 0) & (nodes[there] >= 0)
            sources.append(nodes[here][both])
            targets.append(nodes[there][both])
            step = space.cell * math.hypot(dr, dc)
            weights.append(0.5 * step * (cost[here][both] + cost[there][both]))
        s, t, w = (np.concatenate(parts) for parts in (sources, targets, weights))
        ends = (np.concatenate([s, t]), np.concatenate([t, s]))
        return sparse.csr_matrix((np.concatenate([w, w]), ends), shape=(len(self.space.cells),) * 2)

    def path(self, start: ArrayLike, goal: ArrayLike) -> NDArray[np.float64]:
        """Return a collision-free path from start to goal, corner points of shape (k, 2) [m].

        Both ends, shape (2,), are moved to the nearest reachable cell centre. Raises ValueError
        where that is more than a metre away.
        """
        source, target = self._node(start), self._node(goal)
        _, before = csgraph.dijkstra(self._costs, indices=source, return_predecessors=True)
        chain = [target]
        while chain[-1] != source:
            chain.append(int(before[chain[-1]]))
        return self._pull_straight(np.array(chain[::-1]))

    def route(self, stops: ArrayLike) -> NDArray[np.float64]:
        """Return a path through all stops of shape (n, 2) [m] in order, shape (k, 2) [m]."""
        points = np.asarray(stops, dtype=np.float64).reshape(-1, 2)
        parts = [self.path(a, b) for a, b in pairwise(points)]
        if not parts:
            return self._centres(np.array([self._node(points[0])]))
        return np.vstack([parts[0], *(part[1:] for part in parts[1:])])

    def distances(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the length of the way between points of shape (n, 2) [m], shape (n, n) [m].

        Measured along the grid: up to 8 % more than the shortest way.
        """
        nodes = [self._node(p) for p in np.asarray(points, dtype=np.float64)]
        graph = self._join(np.ones_like(self.space.clearance))
        table: NDArray[np.float64] = csgraph.dijkstra(graph, indices=nodes)[:, nodes]
        return table

    def _node(self, point: ArrayLike) -> int:
        x, y = (float(v) for v in np.asarray(point, dtype=np.float64))
        row, column = self.space.nearest_cell(x, y)
        if math.dist(self.space.centre(row, column), (x, y)) > _SNAP_M:
            raise ValueError(
                f"({x:.2f}, {y:.2f}) cannot be reached in {self.space.world.name!r} by a robot of "
                f"radius {self.space.radius} m"
            )
        return int(self._node_of_cell[row, column])

    def _centres(self, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
        rows_columns = self.space.cells[nodes]
        origin = np.array(self.space.origin)
        centres: NDArray[np.float64] = origin + (rows_columns[:, ::-1] + 0.5) * self.space.cell
        return centres

    def _pull_straight(self, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
        """Replace stretches of the grid path by straight moves that come no closer to walls."""
        centres = self._centres(nodes)
        room = self.space.clearance[tuple(self.space.cells[nodes].T)]
        kept, at = [0], 0
        while at < len(nodes) - 1:
            at = self._farthest_straight(centres, room, at)
            kept.append(at)
        return centres[kept]

    def _farthest_straight(
        self, centres: NDArray[np.float64], room: NDArray[np.float64], at: int
    ) -> int:
        """Return the farthest point that a straight move from `at` may go to.

        The neighbour always qualifies: cells keep half a cell's diagonal more than the radius.
        """
        space, best, tightest = self.space, at + 1, min(room[at], room[at + 1])
        for target in range(at + 2, len(centres)):
            tightest = min(tightest, room[target])
            needed = max(space.radius, min(_COMFORT_M, tightest - 0.5 * space.cell))
            if space.world.is_move_free(centres[at], centres[target], float(needed)):
                best = target
            elif target - best > _PATIENCE:
                break
        return best
