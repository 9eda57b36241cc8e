"""Flat scans as the three-dimensional point clouds that most peers want."""

from __future__ import annotations

import math

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from numpy.typing import NDArray

Array = NDArray[np.float64]


def usable_points(scan: Scan, spacing: float = 0.0) -> Array:
    """Return the scan's points (n, 2) [m], at least about `spacing` metres apart, in beam order."""
    points = scan.counter_clockwise().points()
    if spacing <= 0.0 or len(points) == 0:
        return points
    kept = [0]
    for k in range(1, len(points)):
        if math.dist(points[k], points[kept[-1]]) >= spacing:
            kept.append(k)
    return points[kept]


def extruded(points: Array, heights: Array) -> Array:
    """Return the points (n, 2) at each height (k,) [m], (n k, 3).

    Walls become upright planes: a lone flat slice has no normals but the vertical for a program
    that estimates them in space.
    """
    layers = [np.column_stack([points, np.full(len(points), z)]) for z in heights]
    return np.vstack(layers) if layers else np.zeros((0, 3))


def to_matrix(pose: Pose) -> Array:
    """Return the (4, 4) homogeneous matrix of a motion in the plane."""
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    return np.array(
        [[c, -s, 0.0, pose.x], [s, c, 0.0, pose.y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )


def from_matrix(matrix: Array, tilt: float = math.radians(10.0)) -> Pose | None:
    """Return the motion in the plane of a (4, 4) matrix; None if it tilts or flips the plane.

    tilt: greatest angle [rad] between the z axes.
    """
    if not np.all(np.isfinite(matrix)) or matrix[2, 2] < math.cos(tilt):
        return None
    theta = math.atan2(matrix[1, 0] - matrix[0, 1], matrix[0, 0] + matrix[1, 1])
    return Pose(float(matrix[0, 3]), float(matrix[1, 3]), theta)
