"""KISS-Matcher: Faster-PFH, graph pruning and a robust solver. Needs no guess.

H. Lim, D. Kim, G. Shin, J. Shi, I. Vizzo, H. Myung, J. Park and L. Carlone, "KISS-Matcher: fast and
robust point cloud registration revisited", ICRA 2025.

How a flat scan is fed to it: the points at several heights, so that walls are upright planes, and
its solver for rotations about the vertical (Quatro).
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.baselines.answer import hypothesis, nothing
from lineloom_lab.evaluation.peers.points3d import extruded, from_matrix, usable_points


@dataclass(frozen=True, slots=True)
class KissMatcherConfig:
    """Parameters; metres, shares 0..1.

    spacing: of the points. height, layers: the flat scan is repeated at so many heights. voxel:
    its unit of length, of which it derives all radii. enough: inliers for a score of one half.
    """

    spacing: float = 0.05
    height: float = 0.1
    layers: int = 5
    voxel: float = 0.15
    normal_gain: float = 3.0
    feature_gain: float = 8.0
    enough: float = 20.0
    least_score: float = 0.73


class KissMatcherMatcher:
    """The score is n / (n + enough) of its final inliers n: it has no figure of its own in 0..1."""

    def __init__(self, config: KissMatcherConfig | None = None) -> None:
        """Load KISS-Matcher; raises ImportError where it is not installed."""
        self.config = config or KissMatcherConfig()
        kiss: Any = importlib.import_module("kiss_matcher")
        settings = kiss.KISSMatcherConfig(
            voxel_size=self.config.voxel,
            use_voxel_sampling=False,
            use_quatro=True,
            normal_r_gain=self.config.normal_gain,
            fpfh_r_gain=self.config.feature_gain,
        )
        self._matcher = kiss.KISSMatcher(settings)

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "kiss-matcher"

    def prepare(self, scan: Scan) -> NDArray[np.float64]:
        """Repeat the points at several heights, (n, 3) [m]; it extracts features while matching."""
        heights = self.config.height * np.arange(self.config.layers, dtype=np.float64)
        return extruded(usable_points(scan, self.config.spacing), heights)

    def match_prepared(
        self, reference: NDArray[np.float64], current: NDArray[np.float64]
    ) -> MatchResult:
        """Find T_reference_current."""
        least = 3 * self.config.layers
        if len(reference) < least or len(current) < least:
            return nothing("fewer than three points in a scan")
        self._matcher.reset()
        found = self._matcher.estimate(list(current), list(reference))
        inliers = float(self._matcher.get_num_final_inliers())
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = found.rotation, np.ravel(found.translation)
        pose = from_matrix(matrix)
        if not found.valid or pose is None or inliers <= 0.0:
            return nothing("its solver found no motion in the plane")
        score = inliers / (inliers + self.config.enough)
        return hypothesis(pose, score, self.config.least_score, checks={"inliers": inliers})
