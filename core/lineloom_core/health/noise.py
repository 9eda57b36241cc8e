"""Random numbers for ranges: a broken sensor, or bytes read at the wrong place.

Neighbouring beams mostly meet one surface, so their ranges differ by far less than those of beams
that have nothing to do with each other, in any surroundings. Where they do not, a scan is noise.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from lineloom_core.codec import storable
from lineloom_core.health import _kernels as kernels
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_WINDOW, _MOST = 20, 0.75
_LEAST_PAIRS = 30
_ALIKE = 0.5
_LEAST_SPREAD_M = 0.3


@storable("noise-check")
@dataclass
class NoiseCheck:
    """Of the last scans, whether neighbours differ as much as strangers."""

    random: deque[bool] = field(default_factory=lambda: deque(maxlen=_WINDOW))

    @property
    def blinds(self) -> bool:
        """Whether nothing can be had of what the sensor sends now."""
        return sum(self.random) > _MOST * _WINDOW

    def examine(self, sample: Sample) -> None:
        """Look at the next scan."""
        ranges = sample.scan.ranges
        near, pairs = kernels.median_step(ranges, 1)
        far, strangers = kernels.median_step(ranges, len(ranges) // 3)
        if min(pairs, strangers) >= _LEAST_PAIRS:
            self.random.append(far > _LEAST_SPREAD_M and near > _ALIKE * far)

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if not self.blinds:
            return []
        return [
            Finding(
                "random",
                "warning",
                f"in {sum(self.random)} of the last {len(self.random)} scans neighbouring beams "
                "differ as much as any two: these are no distances of anything (a broken lidar, or "
                "bytes read at the wrong place); nothing is made of them",
            )
        ]
