"""A building's floor plan: wall segments without direction or free side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

MOST_LINES = 200_000
MOST_COORDINATE_M = 1e9
"""Far beyond any grid of a country; an infinite length has no meaning."""

_LEAST_LENGTH_M = 0.01


class FloorPlanError(ValueError):
    """A plan that cannot be used; the text says why."""


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """lines: (n, 4) x1, y1, x2, y2 [m] in the plan's own frame; read-only, none shorter than 1 cm.

    Which side of a line is free is not known: drawings do not say.
    """

    lines: NDArray[np.float64]

    @staticmethod
    def of(segments: ArrayLike) -> FloorPlan:
        """Check segments and drop those without length. Raises FloorPlanError."""
        lines = np.array(segments, dtype=np.float64, order="C").reshape(-1, 4)
        if not np.all(np.isfinite(lines)):
            raise FloorPlanError("coordinates must be finite numbers")
        if len(lines) > MOST_LINES:
            raise FloorPlanError(f"{len(lines)} lines are more than {MOST_LINES}")
        lines = lines[lengths(lines) >= _LEAST_LENGTH_M]
        if len(lines) == 0:
            raise FloorPlanError("holds no line of a centimetre or more")
        if np.abs(lines).max() > MOST_COORDINATE_M:
            raise FloorPlanError(f"lies {np.abs(lines).max():.3g} m away: is its unit right?")
        lines.setflags(write=False)
        return FloorPlan(lines)

    @property
    def extent(self) -> float:
        """The longer side of the box around the plan [m]."""
        points = self.lines.reshape(-1, 2)
        return float(np.max(points.max(axis=0) - points.min(axis=0)))


def lengths(lines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lengths of lines (n, 4) [m]."""
    return np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1])
