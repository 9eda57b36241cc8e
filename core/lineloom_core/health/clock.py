"""Stamps that stand still or run backwards, and scans that never change."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_WINDOW = 100
_MOST_SHARE = 0.1
_LEAST_BAD = 5
_FROZEN_SCANS = 10
_LEAST_RETURNS = 30
_DROVE_M, _DROVE_RAD = 0.3, 0.3

_DROPPED = ". The wheels went on meanwhile: nothing is made of these scans"


@storable("clock-check")
@dataclass
class ClockCheck:
    """Time steps of zero or less among the last hundred; single ones occur in sound logs."""

    last: float | None = None
    bad: deque[int] = field(default_factory=lambda: deque(maxlen=_WINDOW))
    """+1 for a step backwards, 0 for none at all, -1 for a sound one."""

    def examine(self, sample: Sample) -> None:
        """Look at the next scan's stamp."""
        stamp = sample.scan.stamp
        if self.last is not None:
            self.bad.append(-1 if stamp > self.last else int(stamp < self.last))
        self.last = stamp

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        back, still = self.bad.count(1), self.bad.count(0)
        if back + still < max(_LEAST_BAD, _MOST_SHARE * len(self.bad)):
            return []
        said = f"of the last {len(self.bad)} scans {still} have the stamp of the one before"
        if back:
            said += f" and {back} an earlier one"
        return [
            Finding(
                "clock",
                "warning",
                f"{said}: stamp must be the time of the first beam, on a clock that only goes "
                "forward; turning is followed less well without",
            )
        ]


@storable("frozen-check")
@dataclass
class FrozenCheck:
    """Scans in a row that equal each other in every beam: no lidar measures without noise.

    drove: how far [m] and by how much [rad] the wheels went meanwhile.
    """

    last: NDArray[np.float64] | None = None
    equal: int = 0
    drove: tuple[float, float] = (0.0, 0.0)

    @property
    def blinds(self) -> bool:
        """Whether the sensor says nothing of where the robot is: it drives, by its wheels."""
        moves = self.drove[0] > _DROVE_M or self.drove[1] > _DROVE_RAD
        return self.equal >= _FROZEN_SCANS and moves

    def examine(self, sample: Sample) -> None:
        """Look at the next scan's ranges."""
        ranges = sample.scan.ranges
        enough = np.count_nonzero(np.isfinite(ranges)) >= _LEAST_RETURNS
        same = self.last is not None and np.array_equal(ranges, self.last, equal_nan=True)
        self.equal = self.equal + 1 if enough and same else 0
        self.last, rolled = ranges, sample.odometry_step
        if self.equal == 0:
            self.drove = (0.0, 0.0)
        elif rolled is not None:
            way, turn = self.drove
            self.drove = way + math.hypot(rolled.x, rolled.y), turn + abs(rolled.theta)

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if self.equal < _FROZEN_SCANS:
            return []
        return [
            Finding(
                "frozen",
                "warning",
                f"the last {self.equal + 1} scans are identical in every beam: the driver sends "
                "one scan again and again; restart it" + (_DROPPED if self.blinds else ""),
            )
        ]
