"""Whether a log becomes the same map when its stamps are others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lineloom_lab.evaluation.log_bench_judge import PlacedRobot, aligned_errors

SAME_M = 0.05
"""So far off, a pose is the same."""

_ROUNDS = 5


def same_share(true: Sequence[PlacedRobot], other: Sequence[PlacedRobot]) -> float | None:
    """Return which share of the scans placed in one map lies likewise in another map of them.

    Of each component, its scans in that component of the other that has most of them, within
    `SAME_M` of where those that agree best say. None where nothing is placed. Raises ValueError
    for maps of other robots or scans.
    """
    if [(r.robot, len(r.poses)) for r in true] != [(r.robot, len(r.poses)) for r in other]:
        raise ValueError("two maps can be compared only where both are of the same scans")
    component, theirs = (np.concatenate([r.component for r in side]) for side in (true, other))
    poses, their_poses = (np.concatenate([r.poses for r in side]) for side in (true, other))
    same = 0
    for name in np.unique(component[component != ""]):
        own = (component == name) & (theirs != "")
        if not own.any():
            continue
        names, counts = np.unique(theirs[own], return_counts=True)
        both = own & (theirs == names[counts.argmax()])
        same += _same(their_poses[both], poses[both])
    placed = int(np.count_nonzero(component != ""))
    return same / placed if placed else None


def _same(poses: NDArray[np.float64], others: NDArray[np.float64]) -> int:
    """Count poses that are the same; those that are not must not pull at the alignment."""
    errors = aligned_errors(poses, others)
    for _ in range(_ROUNDS):
        close = errors <= max(SAME_M, float(np.median(errors)))
        errors = aligned_errors(poses, others, close)
    return int(np.count_nonzero(errors <= SAME_M))
