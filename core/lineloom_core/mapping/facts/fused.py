"""What a registration and wheels know of a pose, each by itself and together."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.graph import observe
from lineloom_core.matching.local_map import Registration

_NEAR = 0.3, 0.15  # m, rad: of where wheels say that it is, a scan was expected


def without_last_bits(found: Registration) -> Registration:
    """The same, its pose to a micrometre and a tenth of a microradian.

    Processors differ in the last bits, and tracking would amplify that to centimetres within
    minutes: a point falls into another cell, a scan becomes a keyframe sooner.
    """
    x, y, theta = found.pose.x, found.pose.y, found.pose.theta
    return replace(found, pose=Pose(round(x, 6), round(y, 6), round(theta, 7)))


def unobserved(found: Registration, least: float) -> float | None:
    """Direction in the map's axes [rad] along which nothing is observed, None if there is none."""
    seen = observe(found.information)
    if seen.lambda_min >= least * seen.lambda_max:
        return None
    return seen.least_known


def fused(
    found: Registration, due: Pose, known: NDArray[np.float64], way: float, turn: float
) -> Pose:
    """The likeliest pose given what scans and wheels each know.

    known: (3, 3), of the scans. way [m], turn [rad]: how far off the wheels may be.
    """
    off = due.to_array() - found.pose.to_array()
    off[2] = angle_difference(due.theta, found.pose.theta)
    held = np.diag([way**-2, way**-2, turn**-2])
    x, y, theta = np.linalg.solve(known + held, held @ off).tolist()
    return Pose(found.pose.x + x, found.pose.y + y, found.pose.theta + theta)


def is_near(pose: Pose, rolled: Pose) -> bool:
    """Whether a pose is about where wheels say that it is."""
    turned = abs(angle_difference(pose.theta, rolled.theta))
    return pose.distance(rolled) < _NEAR[0] and turned < _NEAR[1]


def in_own_axes(found: Registration) -> NDArray[np.float64]:
    """Its information (3, 3) in the laser's axes."""
    c, s = math.cos(found.pose.theta), math.sin(found.pose.theta)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned: NDArray[np.float64] = R.T @ found.information @ R
    return turned
