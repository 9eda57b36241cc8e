"""How well a map lies in a plan at a pose: refined, then judged in both directions.

SciPy is imported where the first map is judged: a service that starts need not wait for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lineloom_core.floorplan.samples import Samples
from lineloom_core.fusion.occupancy import FREE, OCCUPIED, OccupancyGrid
from lineloom_core.geometry import Pose

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

TOLERANCE_M = 0.3
"""Plan and wall: what is drawn where, plaster, and the map's own error."""

_PARALLEL_RAD = math.radians(12.0)
_GATES_M = (1.5, 1.0, 0.7, 0.5, 0.3, 0.3)
_HUBER_M = 0.1
_DIRECTION_M = 1.0
"""In the search for the nearest: a turn of a radian counts as so many metres, twice."""

CONFIRMED, MISSING, UNSEEN = 1, 2, 0


@dataclass(frozen=True, slots=True)
class Fit:
    """explained, unexplained [m]: the map's walls on, and off, the plan's. confirmed, missing [m]:
    the plan's walls that were seen, and those in whose place free space was seen. across [m]:
    explained wall that holds the map against its least held direction."""

    T_plan_map: Pose
    explained: float
    unexplained: float
    confirmed: float
    missing: float
    across: float

    @property
    def support(self) -> float:
        """Metres of wall that speak for this pose less those that speak against it."""
        return self.explained - self.missing

    @property
    def share_explained(self) -> float:
        """Of the map's walls, 0..1."""
        return _share(self.explained, self.unexplained)

    @property
    def share_missing(self) -> float:
        """Of the plan's walls that could be judged, 0..1."""
        return _share(self.missing, self.confirmed)


@dataclass(frozen=True, eq=False)
class Judge:
    """Compares one map with one plan. plan: sampled densely, site: the map's lines, both in their
    own frames. grid: what the map knows to be free, in the map's frame."""

    plan: Samples
    site: Samples
    grid: OccupancyGrid

    def refine(self, T_plan_map: Pose) -> Pose:
        """Return the pose at which the map's lines lie best on the plan's, near a given one.

        Gauss-Newton on the distances of samples from parallel lines (Huber), in narrowing gates.
        """
        T = T_plan_map
        for gate in _GATES_M:
            matched = self._match(T, gate)
            if matched is None:
                return T
            points, normals, offsets, weights = matched
            centre = points.mean(axis=0)
            arm = points - centre
            J = np.column_stack([normals, arm[:, 0] * normals[:, 1] - arm[:, 1] * normals[:, 0]])
            w = weights * np.minimum(1.0, _HUBER_M / np.maximum(np.abs(offsets), 1e-9))
            H = J.T @ (w[:, None] * J) + 1e-6 * np.eye(3)
            dx, dy, turn = np.linalg.solve(H, -J.T @ (w * offsets)).tolist()
            about = Pose(float(centre[0]), float(centre[1]), 0.0)
            T = Pose(dx, dy, 0.0) @ about @ Pose(0.0, 0.0, turn) @ about.inverse() @ T
        return T

    def judge(self, T_plan_map: Pose) -> Fit:
        """Measure a pose."""
        on_plan = self.on_plan(T_plan_map)
        weight = self.site.weight
        states = self.states(T_plan_map)
        explained = float(weight[on_plan].sum())
        direction = self.site.direction[on_plan]
        normals = np.column_stack([-np.sin(direction), np.cos(direction)])
        held = (normals * weight[on_plan, None]).T @ normals
        return Fit(
            T_plan_map=T_plan_map,
            explained=explained,
            unexplained=float(weight.sum()) - explained,
            confirmed=float(self.plan.weight[states == CONFIRMED].sum()),
            missing=float(self.plan.weight[states == MISSING].sum()),
            across=float(np.linalg.eigvalsh(held)[0]) if on_plan.any() else 0.0,
        )

    def on_plan(self, T_plan_map: Pose) -> NDArray[np.bool_]:
        """Tell of each of the map's samples whether it lies on a parallel line of the plan."""
        points = T_plan_map.transform(self.site.points)
        direction = self.site.direction + T_plan_map.theta
        nearest, offset, parallel = self._nearest(points, direction)
        along = np.hypot(*(points - self.plan.points[nearest]).T)
        near: NDArray[np.bool_] = (np.abs(offset) <= TOLERANCE_M) & (along <= 1.5 * TOLERANCE_M)
        return near & parallel

    def states(self, T_plan_map: Pose) -> NDArray[np.int8]:
        """Tell of each of the plan's samples whether it is CONFIRMED, MISSING or UNSEEN."""
        i, j, inside = self._cells_at(T_plan_map.inverse().transform(self.plan.points))
        near = inside & (self._from_walls[i, j] <= TOLERANCE_M)
        free = inside & (self.grid.cells[i, j] == FREE) & ~near
        return np.where(near, CONFIRMED, np.where(free, MISSING, UNSEEN)).astype(np.int8)

    def seen_through(self, T_plan_map: Pose) -> NDArray[np.bool_]:
        """Tell of each of the plan's samples whether free space was seen on both of its sides.

        Beams that only graze a wall pass through its cells too, and say nothing of what is behind.
        """
        T, direction = T_plan_map.inverse(), self.plan.direction
        aside = TOLERANCE_M * np.column_stack([-np.sin(direction), np.cos(direction)])
        through = np.ones(len(direction), dtype=np.bool_)
        for shift in (aside, -aside):
            i, j, inside = self._cells_at(T.transform(self.plan.points + shift))
            through &= inside & (self.grid.cells[i, j] == FREE)
        return through

    def _cells_at(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Row and column of the grid's cell at each point of the map, and whether there is one."""
        cells = np.floor((points - [self.grid.x, self.grid.y]) / self.grid.resolution)
        j, i = cells.astype(np.int64).T
        rows, columns = self.grid.cells.shape
        inside = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
        return np.where(inside, i, 0), np.where(inside, j, 0), inside

    @cached_property
    def _from_walls(self) -> NDArray[np.float64]:
        """Distance of each cell from the nearest occupied one [m]."""
        occupied = self.grid.cells == OCCUPIED
        if not occupied.any():
            return np.full(occupied.shape, np.inf)
        from scipy.ndimage import distance_transform_edt

        far: NDArray[np.float64] = distance_transform_edt(~occupied, self.grid.resolution)
        return far

    @cached_property
    def _tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(_embedded(self.plan.points, self.plan.direction))

    def _nearest(
        self, points: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
        """Return per point its plan sample, the distance from that one's line, if parallel."""
        _, nearest = self._tree.query(_embedded(points, direction))
        along = self.plan.direction[nearest]
        normals = np.column_stack([-np.sin(along), np.cos(along)])
        offset = ((points - self.plan.points[nearest]) * normals).sum(axis=1)
        parallel = np.abs(np.sin(direction - along)) <= math.sin(_PARALLEL_RAD)
        return nearest, offset, parallel

    def _match(self, T: Pose, gate: float) -> tuple[NDArray[np.float64], ...] | None:
        """Return points in the plan's frame, normals, offsets and weights within the gate."""
        points = T.transform(self.site.points)
        nearest, offset, parallel = self._nearest(points, self.site.direction + T.theta)
        along = np.hypot(*(points - self.plan.points[nearest]).T)
        kept = parallel & (np.abs(offset) <= gate) & (along <= 2.0 * gate)
        if kept.sum() < 10:
            return None
        direction = self.plan.direction[nearest[kept]]
        normals = np.column_stack([-np.sin(direction), np.cos(direction)])
        return points[kept], normals, offset[kept], self.site.weight[kept]


def _embedded(points: NDArray[np.float64], direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points and directions (modulo a half turn) in one space of four dimensions."""
    double = 2.0 * direction
    return np.column_stack([points, _DIRECTION_M * np.cos(double), _DIRECTION_M * np.sin(double)])


def _share(part: float, rest: float) -> float:
    return part / (part + rest) if part + rest > 0.0 else 0.0
