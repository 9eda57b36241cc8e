"""OpenKarto's correlative scan matcher, as `karto-scanmatcher` packs it. Needs a guess.

K. Konolige, G. Grisetti, R. Kuemmerle, W. Burgard, B. Limketkai and R. Vincent, "Efficient sparse
pose adjustment for 2D mapping", IROS 2010; E. Olson, "Real-time correlative scan matching", ICRA
2009. It searches a window about the guess and never leaves it.
"""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan

from lineloom_lab.baselines.answer import hypothesis, nothing


@dataclass(frozen=True, slots=True)
class KartoConfig:
    """Parameters; metres, radians, shares 0..1.

    search: side of the window of positions. angle: half width of the window of rotations.
    resolution: cell of the correlation grid. smear: blur of the grid.
    """

    search: float = 1.0
    angle: float = math.radians(20.0)
    resolution: float = 0.025
    smear: float = 0.05
    least_score: float = 0.58


@dataclass(frozen=True, eq=False)
class Laser:
    """Ranges as karto reads them (0 where unknown) and the description of the lidar."""

    ranges: list[float]
    description: Any
    hits: int


class KartoMatcher:
    """The score is karto's response: the share of the smeared grid's height under the points."""

    def __init__(self, config: KartoConfig | None = None) -> None:
        """Load karto; raises ImportError where it is not installed."""
        self.config = config or KartoConfig()
        self._karto: Any = importlib.import_module("karto_scanmatcher")
        settings = self._karto.ScanMatcherConfig()
        settings.search_size = self.config.search
        settings.coarse_search_angle_offset = self.config.angle
        settings.resolution = self.config.resolution
        settings.smear_deviation = self.config.smear
        # Response expansion would leave the window's angles for those that start far off.
        settings.use_response_expansion = False
        self._matcher = self._karto.Wrapper(settings)

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "karto"

    def prepare(self, scan: Scan) -> Laser:
        """Write the scan in karto's terms."""
        sweep = scan.counter_clockwise()
        hit = np.isfinite(sweep.ranges)
        last = sweep.angle_min + sweep.angle_increment * (len(sweep) - 1)
        description = self._karto.LaserScanConfig(
            sweep.angle_min, last, sweep.angle_increment, max(sweep.range_min, 0.01),
            sweep.range_max, sweep.range_max, "laser",
        )  # fmt: skip
        return Laser(np.where(hit, sweep.ranges, 0.0).tolist(), description, int(hit.sum()))

    def match_prepared(self, reference: Laser, current: Laser) -> MatchResult:
        """Find T_reference_current in the window about identity."""
        return self.match_from(reference, current, Pose.identity())

    def match_from(self, reference: Laser, current: Laser, guess: Pose) -> MatchResult:
        """Find T_reference_current in the window about `guess`."""
        if reference.hits < 3 or current.hits < 3:
            return nothing("fewer than three returns in a scan")
        found = self._matcher.match_scan(
            self._localized(current, guess, 1),
            [self._localized(reference, Pose.identity(), 0)],
            False,
            True,
        )
        best = found.best_pose
        return hypothesis(
            Pose(best.x, best.y, math.remainder(best.yaw, math.tau)),
            float(found.response),
            self.config.least_score,
            covariance=np.asarray(found.covariance, dtype=np.float64),
        )

    def _localized(self, laser: Laser, pose: Pose, number: int) -> Any:
        at = self._karto.Pose2(pose.x, pose.y, pose.theta)
        return self._karto.LocalizedRangeScan(
            laser.description, laser.ranges, at, at, number, float(number)
        )
