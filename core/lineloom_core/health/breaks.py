"""Tracks that break again and again, and maps that stay empty: what the scans lack."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_WINDOW, _LEAST = 200, 30
_BREAKS, _UNPLACED, _HOPELESS = 5, 0.3, 0.3
_FAST_RAD, _FAR_M = math.radians(20.0), 0.7
_FEW_RETURNS, _NARROW_RAD = 0.15, math.radians(150.0)


@storable("break-check")
@dataclass
class BreakCheck:
    """The last scans: rows placed, a new track begun, moved [m], turned [rad], share of returns."""

    rows: deque[tuple[float, float, float, float, float]] = field(
        default_factory=lambda: deque(maxlen=_WINDOW)
    )
    sweep_rad: float = 0.0
    has_wheels: bool = False
    placed_before: bool = False

    def examine(self, sample: Sample) -> None:
        """Note what became of the next scan; what blinds the sensor is told by another check."""
        if sample.is_blinded:
            return
        scan = sample.scan
        self.sweep_rad = scan.angle_increment * len(scan)
        self.has_wheels = scan.odometry is not None
        step = sample.odometry_step or sample.step
        moved = 0.0 if step is None else math.hypot(step.x, step.y)
        turned = 0.0 if step is None else abs(step.theta)
        returns = float(np.count_nonzero(np.isfinite(sample.features.ranges))) / len(scan)
        began = self.placed_before and sample.began
        self.placed_before = self.placed_before or sample.placed
        self.rows.append((float(sample.placed), float(began), moved, turned, returns))

    @property
    def is_hopeless(self) -> bool:
        """Whether hardly any scan lately has a place beside the one before."""
        last = list(self.rows)[-_LEAST:]
        follow = sum(placed == 1.0 and began == 0.0 for placed, began, *_ in last)
        return len(last) == _LEAST and follow < _HOPELESS * _LEAST

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if len(self.rows) < _LEAST or not self.placed_before:
            return []
        placed, began, moved, turned, returns = np.array(self.rows).T
        lost = int(np.count_nonzero(placed == 0.0))
        if began.sum() < _BREAKS and lost < _UNPLACED * len(placed):
            return []
        said = f"of the last {len(placed)} scans {lost} have no place"
        if began.any():
            said += f", and tracking began anew {int(began.sum())} times"
        return [
            Finding("breaks", "warning", f"{said}: {self._why(moved, turned, returns)}"),
        ]

    def _why(
        self, moved: NDArray[np.float64], turned: NDArray[np.float64], returns: NDArray[np.float64]
    ) -> str:
        """What the figures say, all of it: one cause may be behind another."""
        far, turn = (float(np.quantile(each, 0.9)) for each in (moved, turned))
        seen = float(np.median(returns))
        causes = []
        if turn > _FAST_RAD:
            causes.append(f"it turns up to {math.degrees(turn):.0f} degrees between two scans")
        if far > _FAR_M:
            causes.append(f"it drives up to {far:.1f} m between two scans")
        if causes:
            causes[-1] += " (send every scan, or drive slower)"
        if seen < _FEW_RETURNS:
            causes.append(
                f"only {100 * seen:.0f} % of the beams have a return (look at the lidar, its reach "
                "and what absorbs its light)"
            )
        if abs(self.sweep_rad) < _NARROW_RAD and not self.has_wheels:
            causes.append(
                f"the view is {math.degrees(abs(self.sweep_rad)):.0f} degrees wide (send odometry)"
            )
        if causes:
            return "; ".join(causes)
        helps = "" if self.has_wheels else "; odometry would carry it over"
        return (
            "scans do not fit each other, and nothing here says why. Surroundings that look the "
            "same everywhere, a crowd around the lidar, or beams at wrong angles do that" + helps
        )
