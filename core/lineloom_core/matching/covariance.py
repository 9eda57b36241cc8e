"""How far off a matched pose may be: the covariance of its error.

The refinement is a weighted least-squares estimate x = H^-1 J'W e. Its weights W hold floors that
keep long walls from ruling, so H^-1 is not its covariance. That is H^-1 (J'W S W J) H^-1, S being
the covariance of what was measured: the noise of each line's own points, once per line however
many residuals it takes part in, and of each corner, wall end and centre of a circle. What is left
is compared with what S says: where walls agree less than their noise allows (they bend, furniture
was moved), or better, the whole is scaled by that measured ratio.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.matching import _covariance_kernels as _kernels
from lineloom_core.matching._refinement_kernels import LAST_ANGLE_GATE, LAST_DISTANCE_GATE
from lineloom_core.matching._sweep import Sweep

SLIDE_SIGMA = 4.0
"""Standard deviation [m] along a weak direction: how far two overlapping views may slide."""
FOUND_SIGMA = 0.1
"""The same where lines do not fix the direction, but all else that was seen does."""


Claim = Literal["lines", "found", "weak"]
"""What is said along the direction that walls fix least: what lines know of it; that, or
FOUND_SIGMA where they know less; SLIDE_SIGMA."""


def pose_covariance(
    reference: Sweep, current: Sweep, pose: Pose, axis: float = 0.0, claim: Claim = "lines"
) -> NDArray[np.float64]:
    """Covariance (3, 3) over x, y, theta [m, rad] of T_reference_current = `pose`.

    In the reference frame. axis: the direction [rad] that walls fix least.
    """
    sigma = {"lines": np.inf, "found": FOUND_SIGMA, "weak": SLIDE_SIGMA}[claim]
    covariance = np.empty((3, 3))
    _kernels.fill_covariance(
        reference, current, pose.to_array(), LAST_ANGLE_GATE, LAST_DISTANCE_GATE,
        axis, sigma, claim == "weak", covariance,
    )  # fmt: skip
    return covariance
