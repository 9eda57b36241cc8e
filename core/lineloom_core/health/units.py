"""Ranges in a wrong unit, and lidars that see nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lineloom_core.codec import storable
from lineloom_core.health import _kernels as kernels
from lineloom_core.health.finding import Finding
from lineloom_core.health.sample import Sample

_SCANS = 10
_BLIND_SCANS = 20
_FAR_M = 100.0
_MILLIMETRES = 700.0
"""Half of all returns within 0.7 m, or within 7 m, according to what it is."""
_NEAR_M = 0.2
_BLIND_SHARE = 0.02


@storable("units-check")
@dataclass
class UnitsCheck:
    """Counts scans in a row that are too large, too small or empty. No room measures 100 m across
    for half of all beams, ten scans long; a lidar indoors never sees nothing for long."""

    huge: int = 0
    tiny: int = 0
    blind: int = 0
    median_m: float = 0.0

    def examine(self, sample: Sample) -> None:
        """Look at the next scan."""
        ranges = sample.scan.ranges
        median, seen = kernels.median_step(ranges, 0)
        if seen < _BLIND_SHARE * len(ranges) or seen == 0:
            self.blind, self.huge, self.tiny = self.blind + 1, 0, 0
            return
        self.blind = 0
        self.median_m = median
        self.huge = self.huge + 1 if self.median_m > _FAR_M else 0
        covered = seen > 0.8 * len(ranges) and median < _NEAR_M
        if covered:
            covered = bool(ranges[np.isfinite(ranges)].max() < _NEAR_M)
        self.tiny = self.tiny + 1 if covered else 0

    def findings(self) -> list[Finding]:
        """What is wrong now."""
        if self.huge >= _SCANS:
            unit, factor = ("milli", 1000) if self.median_m > _MILLIMETRES else ("centi", 100)
            return [
                Finding(
                    "units",
                    "error",
                    f"half of all returns are farther than {self.median_m:.0f} m: ranges are in "
                    f"{unit}metres, it seems; send metres (divide ranges, range_min and range_max "
                    f"by {factor})",
                )
            ]
        if self.tiny >= _SCANS:
            return [
                Finding(
                    "units",
                    "error",
                    f"everything is nearer than {_NEAR_M:.1f} m in every direction: the lidar is "
                    "covered, or ranges are not in metres",
                )
            ]
        if self.blind >= _BLIND_SCANS:
            return [
                Finding(
                    "no-returns",
                    "warning",
                    f"the last {self.blind} scans hold no returns: all ranges are invalid or "
                    "beyond range_max; if ranges are in millimetres, send metres; else look at "
                    "the lidar",
                )
            ]
        return []
