"""The total length of overlapping line segments under trial poses (thesis §2.2.4, [3])."""

from __future__ import annotations

import numpy as np
from lineloom_core.geometry.angles import wrap_array
from numpy.typing import NDArray

Array = NDArray[np.float64]


def overlapping_length(
    reference: Array, current: Array, poses: Array, *, angle: float, distance: float
) -> Array:
    """Return, for each pose, the length of current segments that lies on reference segments [m].

    reference: (n, 12), current: (m, 12) as `ScanFeatures.lines`; poses: (t, 3) T_reference_current
    [m, rad]. A pair counts where directions differ by less than `angle` [rad] and the current
    segment's centre lies within `distance` [m] of the reference line; each current segment counts
    its best pair. Shape (t,).
    """
    x, y, theta = poses.T
    c, s = np.cos(theta)[:, None], np.sin(theta)[:, None]
    centre = 0.5 * (current[:, 0:2] + current[:, 2:4])
    mid_x = c * centre[:, 0] - s * centre[:, 1] + x[:, None]
    mid_y = s * centre[:, 0] + c * centre[:, 1] + y[:, None]
    direction = theta[:, None] + current[:, 4]
    best = np.zeros((len(poses), len(current)))
    for line in reference:
        ux, uy = np.cos(line[4]), np.sin(line[4])
        along = ux * mid_x + uy * mid_y - (ux * line[0] + uy * line[1])
        across = ux * mid_y - uy * mid_x - line[5]
        half = 0.5 * current[:, 6]
        shared = np.minimum(along + half, line[6]) - np.maximum(along - half, 0.0)
        fits = (np.abs(across) < distance) & (np.abs(wrap_array(direction - line[4])) < angle)
        best = np.maximum(best, np.where(fits, shared, 0.0))
    total: Array = best.sum(axis=1)
    return total
