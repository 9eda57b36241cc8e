"""The absolute error of a trajectory against a reference, after a rigid alignment.

As Sturm et al. 2012 (TUM RGB-D benchmark) define the absolute trajectory error: the map frame of an
estimate is arbitrary, so the best rigid motion is taken out first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from numpy.typing import NDArray

_LEAST_SPREAD_M = 1e-6


class DegenerateTrajectoryError(ValueError):
    """Too few common poses, or all in one place: there is nothing to align by."""


@dataclass(frozen=True, slots=True)
class TrajectoryError:
    """Distances between aligned estimate and reference over n common poses.

    rmse, mean, max: of the positions [m]. rotation_rmse: of the headings [rad].
    T_truth_estimate: the alignment taken out.
    """

    rmse: float
    max: float
    mean: float
    n: int
    rotation_rmse: float
    T_truth_estimate: Pose


def align_rigid(estimate: NDArray[np.float64], truth: NDArray[np.float64]) -> Pose:
    """Return T_truth_estimate that brings the positions together in the least-squares sense.

    estimate, truth: (n, 3), rows x, y, theta (m, m, rad), row i of one belongs to row i of the
    other. Rows with a NaN in either are left out. The closed form of Umeyama 1991 in the plane,
    without scale: the angle of sum((e - e_mean)* (t - t_mean)) taken as complex numbers.

    Raises ValueError for other shapes, DegenerateTrajectoryError for fewer than two common poses
    or positions that all coincide.
    """
    e, t = _common(estimate, truth)
    if e.shape[0] < 2:
        raise DegenerateTrajectoryError(f"{e.shape[0]} common poses: at least 2 are needed")
    e_mean, t_mean = e[:, :2].mean(axis=0), t[:, :2].mean(axis=0)
    e0, t0 = e[:, :2] - e_mean, t[:, :2] - t_mean
    if min(float(np.abs(e0).max()), float(np.abs(t0).max())) < _LEAST_SPREAD_M:
        raise DegenerateTrajectoryError("the positions all coincide: no direction to align by")
    cosine = float(np.sum(e0 * t0))
    sine = float(np.sum(e0[:, 0] * t0[:, 1] - e0[:, 1] * t0[:, 0]))
    turned = Pose(0.0, 0.0, math.atan2(sine, cosine)).transform(e_mean[None, :])[0]
    x, y = (t_mean - turned).tolist()
    return Pose(x, y, math.atan2(sine, cosine))


def trajectory_error(
    estimate: NDArray[np.float64], truth: NDArray[np.float64], *, align: bool = True
) -> TrajectoryError:
    """Return the error of an estimate, rows x, y, theta (n, 3), against the reference.

    Rows with a NaN in either are left out. `align=False` takes both as given in one frame. Raises
    as `align_rigid` does, and DegenerateTrajectoryError where no pose is common.
    """
    T = align_rigid(estimate, truth) if align else Pose.identity()
    e, t = _common(estimate, truth)
    if e.shape[0] == 0:
        raise DegenerateTrajectoryError("no common poses")
    distance = np.linalg.norm(T.transform(e[:, :2]) - t[:, :2], axis=1)
    turn = wrap_array(e[:, 2] + T.theta - t[:, 2])
    return TrajectoryError(
        rmse=float(np.sqrt(np.mean(distance**2))),
        max=float(distance.max()),
        mean=float(distance.mean()),
        n=int(e.shape[0]),
        rotation_rmse=float(np.sqrt(np.mean(turn**2))),
        T_truth_estimate=T,
    )


def _common(
    estimate: NDArray[np.float64], truth: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if estimate.shape != truth.shape or estimate.ndim != 2 or estimate.shape[1] != 3:
        raise ValueError(
            f"expected two arrays of one shape (n, 3), got {estimate.shape} and {truth.shape}"
        )
    good = np.isfinite(estimate).all(axis=1) & np.isfinite(truth).all(axis=1)
    return estimate[good], truth[good]
