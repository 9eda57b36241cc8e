"""How far off a matched pose may be: the covariance of its error.

The refinement is a weighted least-squares estimate x = H^-1 J'W e. Its weights W hold floors that
keep long walls from ruling, so H^-1 is not its covariance. That is H^-1 (J'W S W J) H^-1, S being
the covariance of what was measured: the noise of each line's own points, once per line however
many residuals it takes part in, and of each corner, wall end and centre of a circle. What is left
is compared with what S says: where walls agree less than their noise allows (they bend, furniture
was moved), or better, the whole is scaled by that measured ratio.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.matching import _covariance_kernels as _kernels
from lineloom_core.matching._refinement_kernels import LAST_ANGLE_GATE, LAST_DISTANCE_GATE

UNSEEN = np.diag([0.01, 0.01, 1.0])
"""Information of what nothing observes: 10 m and 1 rad."""
SLIDE_SIGMA = 4.0
"""Standard deviation [m] along a weak direction: how far two overlapping views may slide."""
TRUSTED_COUNT = 10.0
"""Residuals that agree with their noise and are counted beside the measured ones."""


def pose_covariance(
    reference: ScanFeatures,
    current: ScanFeatures,
    pose: Pose,
    weak_direction: float | None = None,
) -> NDArray[np.float64]:
    """Covariance (3, 3) over x, y, theta [m, rad] of T_reference_current = `pose`.

    In the reference frame. Along `weak_direction` [rad] nothing is claimed: SLIDE_SIGMA.
    """
    H, M = np.zeros((3, 3)), np.zeros((3, 3))
    r, c = reference, current
    squares, used = _kernels.scan_noise(
        r.lines, r.ends, r.edges, r.circles, r.points, r.beams, len(r.ranges), r.angle_increment,
        c.lines, c.ends, c.edges, c.circles, c.points, c.beams, len(c.ranges), c.angle_increment,
        pose.to_array(), LAST_ANGLE_GATE, LAST_DISTANCE_GATE, H, M,
    )  # fmt: skip
    inverse = np.linalg.inv(H + UNSEEN)
    ratio = (squares + TRUSTED_COUNT) / (max(used - 3.0, 0.0) + TRUSTED_COUNT)
    covariance = inverse @ (M * ratio + UNSEEN) @ inverse
    covariance = 0.5 * (covariance + covariance.T)
    return covariance if weak_direction is None else _slid(covariance, weak_direction)


def _slid(covariance: NDArray[np.float64], direction: float) -> NDArray[np.float64]:
    """The same, but for the slide along `direction`, which is not known at all.

    The direction is that of the reference's walls and as noisy as they are, which is half of what
    is not known of the rotation: a slide of metres along it is one of millimetres across.
    """
    c, s = math.cos(direction), math.sin(direction)
    along, across = np.array([c, s, 0.0]), np.array([-s, c, 0.0])
    keep = np.eye(3) - np.outer(along, along)
    turned = 0.5 * covariance[2, 2]
    found: NDArray[np.float64] = (
        keep @ covariance @ keep
        + SLIDE_SIGMA**2 * np.outer(along, along)
        + SLIDE_SIGMA**2 * turned * np.outer(across, across)
    )
    return found
