"""Surroundings without a straight piece of wall: a map of lines stays empty there."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from lineloom_core.codec import storable
from lineloom_core.features._kernels import LENGTH
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_WINDOW, _LEAST = 100, 60
_LEAST_M = 0.3
_MOST_LINED, _FEW = 0.1, 0.05


@storable("no-lines-check")
@dataclass
class NoLinesCheck:
    """The last scans: whether each shows a straight piece of wall, and its share of returns."""

    lined: deque[bool] = field(default_factory=lambda: deque(maxlen=_WINDOW))
    returns: deque[float] = field(default_factory=lambda: deque(maxlen=_WINDOW))

    def examine(self, sample: Sample) -> None:
        """Look at the next scan."""
        if sample.is_blinded:
            return
        features = sample.features
        seen = float(np.count_nonzero(np.isfinite(features.ranges))) / len(features.ranges)
        self.lined.append(bool(np.any(features.lines[:, LENGTH] >= _LEAST_M)))
        self.returns.append(seen)

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if len(self.lined) < _LEAST or sum(self.lined) > _MOST_LINED * len(self.lined):
            return []
        share = sum(self.returns) / len(self.returns)
        if share == 0.0:
            return []  # the check of units says so
        why = (
            f"only {100 * share:.0f} % of the beams have a return: the place is larger than the "
            "lidar's reach, or its surfaces give nothing back"
            if share < _FEW
            else "what it sees is round or small (trees, columns, crowds, clutter)"
        )
        return [
            Finding(
                "no-lines",
                "note",
                f"of the last {len(self.lined)} scans {len(self.lined) - sum(self.lined)} show no "
                f"straight piece of wall; {why}. The map of lines stays empty here, while poses "
                "and the occupancy grid may be right",
            )
        ]
