"""What a registration is worth as a constraint: information matrices, order x, y, theta."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.graph import project_out_weak

INDEPENDENT_SHARE = 0.05
"""Neighbouring points of a scan err together: this share of them counts as independent."""

_FLOOR = np.diag([0.006**2, 0.006**2, 0.002**2])  # m^2, m^2, rad^2: the lidar's own limits


def turned(information: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Information on (x, y, theta) seen from axes that are rotated by `angle` [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    result: NDArray[np.float64] = R.T @ information @ R
    return result


def step_information(
    registered: NDArray[np.float64], prior_sigma: tuple[float, float]
) -> NDArray[np.float64]:
    """Information of a tracked step: correlated points, a weak motion prior, the lidar's floor.

    prior_sigma: how far (m, rad) the motion model can be off where nothing is observed.
    """
    hold = np.diag([prior_sigma[0] ** -2, prior_sigma[0] ** -2, prior_sigma[1] ** -2])
    covariance = np.linalg.inv(INDEPENDENT_SHARE * registered + hold) + _FLOOR
    return _symmetric(np.linalg.inv(covariance))


def observed_information(registered: NDArray[np.float64]) -> NDArray[np.float64]:
    """Information of a loop or rendezvous: only what is really observed, the floor added."""
    seen = project_out_weak(INDEPENDENT_SHARE * registered)
    # (seen^-1 + floor)^-1 without inverting the singular: W = S - S (S + F^-1)^-1 S.
    inner = np.linalg.inv(seen + np.linalg.inv(_FLOOR))
    return _symmetric(seen - seen @ inner @ seen)


def _symmetric(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    result: NDArray[np.float64] = 0.5 * (matrix + matrix.T)
    return result
