"""What wheels alone would have made of a log: a map with odometry must not be worse."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lineloom_lab.evaluation.log_bench_judge import aligned_errors
from lineloom_lab.evaluation.log_bench_log import Recording

WORSE_M, WORSE_SHARE = 0.02, 0.05
"""A map may be so much more wrong than wheels alone, both together."""


def wheels_rmse(robots: Sequence[Recording]) -> float | None:
    """Return the rms error of the odometry that scans carry, each robot aligned by itself [m].

    None where no scan with a reference has any.
    """
    errors = []
    for robot in robots:
        rows = [
            (scan.odometry.to_array(), true)
            for scan, true in zip(robot.scans, robot.reference, strict=True)
            if scan.odometry is not None and np.isfinite(true).all()
        ]
        if rows:
            believed, truth = (np.array(column) for column in zip(*rows, strict=True))
            errors.append(aligned_errors(believed, truth))
    if not errors:
        return None
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def is_worse(ate_rmse: float | None, wheels: float | None) -> bool:
    """Whether a map's error is further above that of wheels alone than it may be [m]."""
    if ate_rmse is None or wheels is None:
        return False
    return ate_rmse > (1.0 + WORSE_SHARE) * wheels + WORSE_M
