"""small_gicp: generalised ICP. Needs a guess.

K. Koide, "small_gicp: efficient and parallel algorithms for point cloud registration", Journal of
Open Source Software 9(100), 2024; A. Segal, D. Haehnel and S. Thrun, "Generalized-ICP", RSS 2009.

How a flat scan is fed to it: the points at several heights, so that walls are upright planes.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan

from lineloom_lab.baselines.answer import hypothesis, nothing
from lineloom_lab.evaluation.peers.points3d import (
    extruded,
    from_matrix,
    to_matrix,
    usable_points,
)


@dataclass(frozen=True, slots=True)
class SmallGicpConfig:
    """Parameters; metres, shares 0..1.

    spacing: of the points. height, layers: the flat scan is repeated at so many heights. gate:
    greatest distance of a pair. neighbours: for covariances. iterations: at most. kind: which
    residual ("GICP", "PLANE_ICP").
    """

    spacing: float = 0.05
    height: float = 0.2
    layers: int = 3
    gate: float = 0.5
    neighbours: int = 12
    iterations: int = 60
    kind: str = "GICP"
    least_score: float = 0.73


@dataclass(frozen=True, eq=False)
class Cloud:
    """A small_gicp cloud with covariances, its tree, and how many points it has."""

    cloud: Any
    tree: Any
    size: int


class SmallGicpMatcher:
    """The score is the share of the current points with a partner within the gate."""

    def __init__(self, config: SmallGicpConfig | None = None) -> None:
        """Load small_gicp; raises ImportError where it is not installed."""
        self.config = config or SmallGicpConfig()
        self._gicp: Any = importlib.import_module("small_gicp")

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "small-gicp"

    def prepare(self, scan: Scan) -> Cloud:
        """Thin the points, repeat them at several heights, estimate covariances."""
        points = usable_points(scan, self.config.spacing)
        if len(points) < self.config.neighbours:
            return Cloud(None, None, 0)
        heights = self.config.height * np.arange(self.config.layers, dtype=np.float64)
        cloud = self._gicp.PointCloud(extruded(points, heights - heights.mean()))
        tree = self._gicp.KdTree(cloud)
        self._gicp.estimate_normals_covariances(cloud, tree, self.config.neighbours)
        return Cloud(cloud, tree, self.config.layers * len(points))

    def match_prepared(self, reference: Cloud, current: Cloud) -> MatchResult:
        """Find T_reference_current starting from identity."""
        return self.match_from(reference, current, Pose.identity())

    def match_from(self, reference: Cloud, current: Cloud, guess: Pose) -> MatchResult:
        """Find T_reference_current starting from `guess`."""
        if reference.size == 0 or current.size == 0:
            return nothing(f"fewer than {self.config.neighbours} points in a scan")
        found = self._gicp.align(
            reference.cloud,
            current.cloud,
            reference.tree,
            to_matrix(guess),
            registration_type=self.config.kind,
            max_correspondence_distance=self.config.gate,
            num_threads=1,
            max_iterations=self.config.iterations,
        )
        pose = from_matrix(np.asarray(found.T_target_source))
        if pose is None or found.num_inliers < 3:
            return nothing("no motion in the plane has inliers")
        share = found.num_inliers / current.size
        checks = {"inlier_share": share, "error": float(found.error)}
        return hypothesis(pose, share, self.config.least_score, checks=checks)
