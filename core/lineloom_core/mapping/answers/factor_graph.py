"""What gtsam holds of a site at rest, for those who have no gtsam."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable


@storable("factor-graph")
@dataclass(frozen=True, eq=False)
class FactorGraph:
    """n keyframes at the optimum of m factors.

    version: the site's. keyframes: their ids, oldest first. components: of each. poses: (n, 3)
    x, y, theta in its component's frame. ends: (m, 2) rows. measured: (m, 3) T_a_b. information:
    (m, 3, 3) in the tangent at b.
    """

    version: int
    keyframes: tuple[str, ...]
    components: tuple[str, ...]
    poses: NDArray[np.float64]
    ends: NDArray[np.int64]
    measured: NDArray[np.float64]
    information: NDArray[np.float64]
