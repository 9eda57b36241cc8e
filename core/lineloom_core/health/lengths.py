"""Ranges or odometry in another unit of length: scans move k times as far as the wheels.

A map made of ranges that are all k times too long is as consistent as the true one, only larger.
Measured on straight stretches, where it does not matter where on the robot the lidar sits.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_STRETCH_M, _STRAIGHT_RAD = 0.4, 0.12
_STRETCHES, _LEAST = 24, 7
_SHORT, _LONG = 0.85, 1.18
_STEADY = 0.12
_ABSURD = 20.0
_STILL_M, _STUCK_SHARE, _DROVE_M = 0.02, 0.01, 2.5
_CHANGED_M = 0.1


@storable("length-check")
@dataclass
class LengthCheck:
    """Ways by scans and by wheels [m], stretch by stretch; and the stretch that is under way."""

    ways: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_STRETCHES))
    scanned: Pose = field(default_factory=Pose.identity)
    rolled: Pose = field(default_factory=Pose.identity)
    stuck_at: NDArray[np.float64] | None = None
    """What was seen when scans stood still."""

    def examine(self, sample: Sample) -> None:
        """Look at the next step."""
        if self.blinds and self._has_changed(sample.scan.ranges):
            self.ways.clear()
        if sample.step is None or sample.odometry_step is None:
            self.scanned = self.rolled = Pose.identity()
            return
        self.scanned = self.scanned @ sample.step
        self.rolled = self.rolled @ sample.odometry_step
        if max(abs(self.scanned.theta), abs(self.rolled.theta)) > _STRAIGHT_RAD:
            self.scanned = self.rolled = Pose.identity()
            return
        ways = [math.hypot(p.x, p.y) for p in (self.scanned, self.rolled)]
        if max(ways) >= _STRETCH_M and ways[1] > 1e-4:
            self.ways.append((ways[0], ways[1]))
            self.scanned = self.rolled = Pose.identity()

    def _has_changed(self, ranges: NDArray[np.float64]) -> bool:
        """Whether another place is seen than when scans stood still."""
        if self.stuck_at is None or len(self.stuck_at) != len(ranges):
            self.stuck_at = ranges
        with np.errstate(invalid="ignore"):
            off = np.abs(ranges - self.stuck_at)
        off = off[np.isfinite(off)]
        changed = len(off) > 0 and float(np.median(off)) > _CHANGED_M
        if changed:
            self.stuck_at = None
        return changed

    @property
    def blinds(self) -> bool:
        """Whether scans stand still while the wheels drive."""
        if len(self.ways) < _LEAST:
            return False
        last = list(self.ways)[-_LEAST:]
        scanned, rolled = [way for way, _ in last], [way for _, way in last]
        way = sum(rolled)
        return way > _DROVE_M and max(scanned) < min(_STILL_M, _STUCK_SHARE * way)

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if len(self.ways) < _LEAST:
            return []
        if self.blinds:
            return [_stuck(sum(rolled for _, rolled in self.ways))]
        ways = np.maximum(np.array(self.ways), 1e-6)
        logs = np.log(ways[:, 0] / ways[:, 1])
        middle = float(np.median(logs))
        spread = 1.4826 * float(np.median(np.abs(logs - middle)))
        ratio = math.exp(middle)
        if _SHORT < ratio < _LONG or spread > max(_STEADY, 0.1 * abs(middle)):
            return []
        said = f"over {len(ways)} straight stretches scans move {ratio:.3g} times as far as "
        said += f"the odometry says (scatter {100 * spread:.0f} %)"
        if not 1.0 / _ABSURD < ratio < _ABSURD:
            return [
                Finding(
                    "odometry-units",
                    "warning",
                    f"{said}: odometry is not in metres, it seems, and is of no use; send metres",
                )
            ]
        return [
            Finding(
                "length-scale",
                "error",
                f"{said}: ranges are in another unit than metres ({_guess(ratio)}), or else the "
                "odometry's x and y are off by that factor (wheel diameter, ticks). Measure a room "
                "by hand: the map of this robot is too large by the factor if the ranges are",
            )
        ]


def _stuck(rolled: float) -> Finding:
    return Finding(
        "stuck",
        "warning",
        f"the wheels drove {rolled:.1f} m, and scans say that nothing moved: the lidar is covered "
        "or sends old data, or the wheels turn in the air; nothing is made of these scans",
    )


def _guess(ratio: float) -> str:
    for value, name in ((1 / 0.3048, "feet"), (4.0, "quarter millimetres taken for millimetres")):
        if 0.95 * value < ratio < 1.05 * value:
            return name
    return f"divide them by {ratio:.3g}"
