"""The surroundings a robot has just seen, ready to register the next scan against."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.matching import _registration_kernels as _kernels
from lineloom_core.matching import _wide_search_kernels as _wide

_SECTOR_RAD = math.radians(10.0)
_SECTOR_SHIFT = 0.113
"""Beams lie at whole or half degrees: none may lie on a border, where the last bit tells."""
_LEAST_SEARCHED = 5  # points that can be looked for
_LEAST_POINTS = 10  # of half a scan that a registration can be tried with
_HALF_HOLD = np.diag([25.0, 25.0, 100.0])
"""Information that keeps the covariance of half a scan finite where it observes nothing."""


@storable("cloud")
@dataclass(frozen=True, eq=False)
class Cloud:
    """A scan's points as registration wants them.

    points (n, 2) [m] and normals (n, 2) in the laser frame; weights (n,): each point's share of
    wall, at most 1, so that dense near clutter does not outvote far walls. sparse: a thinned
    subset for the exhaustive search.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    weights: NDArray[np.float64]
    sparse: NDArray[np.float64]

    @staticmethod
    def of(features: ScanFeatures) -> Cloud:
        """Prepare the points of one scan."""
        points = features.points
        ranges = np.sqrt(points[:, 0] ** 2 + points[:, 1] ** 2)
        weights = np.minimum(ranges * features.angle_increment / 0.05, 1.0)
        normals = features.normals()
        _kernels.line_normals(points, features.beams, features.lines, normals)
        sparse = points[_kernels.thin(points, 0.12, 90)]
        return Cloud(points, normals, weights, sparse)

    def halves(self) -> tuple[Cloud, Cloud]:
        """Every other sector of 10 degrees, and the rest: two scans of one sweep.

        Sectors, not single beams: what lies side by side errs together.
        """
        bearing = np.arctan2(self.points[:, 1], self.points[:, 0])
        sector = np.floor(bearing / _SECTOR_RAD + _SECTOR_SHIFT)
        first = sector % 2 == 0
        return self.only(first), self.only(~first)

    def only(self, kept: NDArray[np.bool_]) -> Cloud:
        """Some of the points, none of them for the search."""
        return Cloud(self.points[kept], self.normals[kept], self.weights[kept], self.sparse[:0])


_NO_CLOUD = Cloud(*(np.empty(shape) for shape in ((0, 2), (0, 2), 0, (0, 2))))


@dataclass(frozen=True, eq=False)
class LocalMap:
    """A grid of averaged surface points with normals (see `_registration_kernels`).

    In the frame of whoever builds it; built anew when a keyframe is added: that is cheaper than
    forgetting old ones.
    """

    index: NDArray[np.int32]
    surface: NDArray[np.float64]
    field: NDArray[np.uint8]
    ox: float
    oy: float

    @staticmethod
    def build(
        clouds: Iterable[tuple[Cloud, Pose]],
        *,
        kept: NDArray[np.bool_] | None = None,
        reach: float = 18.0,
        searchable: bool = True,
    ) -> LocalMap:
        """Merge clouds at their poses, first come first served; points up to `reach` m away.

        kept: which points, of all clouds one after the other; None for all. Without `searchable`
        the field stays empty and `search` finds nothing.
        """
        rows = [*clouds, (_NO_CLOUD, Pose.identity())]  # one at least to lay beside each other
        begins = np.cumsum([0, *(len(cloud.points) for cloud, _ in rows)])
        points = np.concatenate([cloud.points for cloud, _ in rows])
        normals = np.concatenate([cloud.normals for cloud, _ in rows])
        poses = np.array([pose.to_array() for _, pose in rows])
        if kept is None:
            kept = np.ones(len(points), dtype=np.bool_)
        return LocalMap(*_kernels.build(points, normals, kept, begins, poses, reach, searchable))

    def search(
        self,
        cloud: Cloud,
        guess: Pose,
        *,
        reach_xy: float,
        reach_theta: float,
        pull: float = 0.1,
        step_xy: float = 0.1,
        step_theta: float = math.radians(1.5),
    ) -> tuple[Pose, float]:
        """Best pose in a window around `guess` by exhaustive correlation, and its score 0..1."""
        best = _kernels.correlate(
            self.field, self.ox, self.oy, cloud.sparse, guess.to_array(),
            reach_xy, reach_theta, step_xy, step_theta, pull,
        )  # fmt: skip
        return Pose.from_array(best[:3]), float(best[3])

    def search_around(self, cloud: Cloud, guess: Pose, *, reach: float, most: int) -> list[Pose]:
        """The likeliest poses within `reach` m of a guess, turned in any way, best first."""
        if len(cloud.sparse) < _LEAST_SEARCHED:
            return []
        margin = math.ceil(2.0 * reach / _wide.COARSE) + 1
        cells = (math.ceil(n * _kernels.CELL / _wide.COARSE) for n in self.field.shape)
        nx, ny = (n + 2 * margin for n in cells)
        corner = self.ox - margin * _wide.COARSE, self.oy - margin * _wide.COARSE
        coarse = _wide.coarse_field(self.surface, *corner, nx, ny)
        rows = _wide.search_widely(
            coarse, *corner, self.field, self.ox, self.oy, cloud.sparse, guess.to_array(),
            reach, most,
        )  # fmt: skip
        return [Pose.from_array(row[:3]) for row in rows]

    def register(
        self,
        cloud: Cloud,
        guess: Pose,
        *,
        prior: tuple[float, float, float] = (0.0, 0.0, 0.0),
        gate: float = 0.25,
        sigma: float = 0.03,
        iterations: int = 12,
    ) -> Registration:
        """Refine `guess` by point-to-line registration (see `_registration_kernels.register`)."""
        pose, H, stats = _kernels.register(
            self.index, self.surface, self.ox, self.oy,
            cloud.points, cloud.normals, cloud.weights, guess.to_array(),
            np.array(prior), gate, sigma, iterations,
        )  # fmt: skip
        return Registration(
            Pose.from_array(pose), H, float(stats[0]), float(stats[1]), float(stats[2])
        )

    def disagreement(self, cloud: Cloud, found: Pose) -> float | None:
        """How far two halves of a scan disagree where each is registered by itself.

        As a squared error over what it would be if points erred independently, by the 3 cm that
        `register` takes for them: 1 where they do. It measures in one figure what nobody tells
        us of a lidar and a building: range noise, points that err together, clutter that is not
        the same from two sides. None where a half is too small.
        """
        halves = cloud.halves()
        if min(len(half.points) for half in halves) < _LEAST_POINTS:
            return None
        a, b = (self.register(half, found) for half in halves)
        off = a.pose.to_array() - b.pose.to_array()
        off[2] = angle_difference(a.pose.theta, b.pose.theta)
        held = a.information + _HALF_HOLD, b.information + _HALF_HOLD
        expected = np.linalg.inv(held[0]) + np.linalg.inv(held[1])
        seen = np.trace(np.linalg.solve(held[0] + held[1], a.information + b.information))
        return float(off @ np.linalg.solve(expected, off)) / max(float(seen), 1.0)


@dataclass(frozen=True, eq=False)
class Registration:
    """Outcome of a registration: pose of the cloud in the map's frame.

    information: 3x3 over x, y, theta in the map frame, points taken as independent (so far too
    sure: callers scale it). matched, total: weight of points on a surface and of all inside the
    grid. rms [m] over the matched.
    """

    pose: Pose
    information: NDArray[np.float64]
    matched: float
    total: float
    rms: float

    @property
    def fit(self) -> float:
        """Share of the points that lie on a known surface, 0..1."""
        return self.matched / self.total if self.total > 0.0 else 0.0
