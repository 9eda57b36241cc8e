"""What goes into the fusion and what comes out: arrays of oriented line segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class LineObservations:
    """n segments as single keyframes saw them, carried into one map frame.

    endpoints: (n, 4) x1, y1, x2, y2 [m]; the free side lies on the left of 1 -> 2. sigma: (n,) one
    standard deviation of the line's position across itself [m], > 0. weight: (n,) how often the
    observation counts (1 for a scan's own line). keyframe, robot: (n,) who saw it. stamp: (n,) when
    [s, the robot's clock]. id: (n,) unique, growing with the order of arrival: the oldest
    observation names the fused line, so that the name outlives re-fusion.

    Raises ValueError for arrays that do not fit together, values that are not finite, a sigma or
    weight that is not positive, or ids that repeat.
    """

    endpoints: NDArray[np.float64]
    sigma: NDArray[np.float64]
    weight: NDArray[np.float64]
    keyframe: NDArray[np.int64]
    robot: NDArray[np.int64]
    stamp: NDArray[np.float64]
    id: NDArray[np.int64]

    def __post_init__(self) -> None:
        n = self.endpoints.shape[0]
        if self.endpoints.shape != (n, 4):
            raise ValueError(f"endpoints must have shape (n, 4), not {self.endpoints.shape}")
        for name in ("sigma", "weight", "keyframe", "robot", "stamp", "id"):
            if getattr(self, name).shape != (n,):
                raise ValueError(f"{name} must have shape ({n},)")
        for name in ("endpoints", "sigma", "weight", "stamp"):
            if not np.all(np.isfinite(getattr(self, name))):
                raise ValueError(f"{name} must be finite")
        if n and (self.sigma.min() <= 0.0 or self.weight.min() <= 0.0):
            raise ValueError("sigma and weight must be positive")
        if np.unique(self.id).size != n:
            raise ValueError("ids must be unique")

    def __len__(self) -> int:
        return int(self.endpoints.shape[0])


@dataclass(frozen=True, eq=False)
class FusedLines:
    """m walls, each fused of one or more observations, ordered by id.

    endpoints: (m, 4) as in `LineObservations`. sigma: (m,) of the position across the line [m].
    support: (m,) distinct keyframes. robots: per line the distinct robots, ascending. first_seen,
    last_seen: (m,) least and greatest stamp of its observations [s]. id: (m,) that of the oldest
    observation. line_of: (n,) index of the fused line that an observation went into, -1 for
    observations whose line was dropped.
    """

    endpoints: NDArray[np.float64]
    sigma: NDArray[np.float64]
    support: NDArray[np.int64]
    robots: tuple[tuple[int, ...], ...]
    first_seen: NDArray[np.float64]
    last_seen: NDArray[np.float64]
    id: NDArray[np.int64]
    line_of: NDArray[np.int64]

    def __len__(self) -> int:
        return int(self.endpoints.shape[0])
