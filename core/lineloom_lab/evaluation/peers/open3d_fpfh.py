"""Open3D: fast point feature histograms and RANSAC, refined by ICP. Needs no guess.

Q.-Y. Zhou, J. Park and V. Koltun, "Open3D: a modern library for 3D data processing", 2018; R. B.
Rusu, N. Blodow and M. Beetz, "Fast point feature histograms (FPFH) for 3D registration", ICRA 2009.

How a flat scan is fed to it: the points as they are, at height 0, with normals that we estimate in
the plane and tilt upwards. With normals in the plane a scan and its mirror image have the same
histograms; tilted, they differ, and a match that flips the plane over does not fit.

Seeded, but its thread pool repeats itself on one core only (see `pair_bench`).
"""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan

from lineloom_lab.baselines.answer import hypothesis, nothing
from lineloom_lab.evaluation.peers.points3d import from_matrix


@dataclass(frozen=True, slots=True)
class Open3dConfig:
    """Parameters; metres, radians, shares 0..1.

    spacing: voxel that points are thinned to. feature_radius: of the histograms. tilt: of the
    normals out of the plane. inlier: greatest distance of a pair. edge_length: how alike the sides
    of a sampled triangle must be. iterations, confidence: of RANSAC. seed: of its dice.
    """

    spacing: float = 0.07
    feature_radius: float = 2.0
    tilt: float = math.radians(30.0)
    inlier: float = 0.2
    edge_length: float = 0.9
    iterations: int = 20_000
    confidence: float = 0.999
    refined_inlier: float = 0.15
    least_score: float = 0.54
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Described:
    """An Open3D point cloud and its histograms."""

    cloud: Any
    features: Any
    size: int


class Open3dMatcher:
    """FPFH + RANSAC + point-to-plane ICP. The score is Open3D's fitness: the share of inliers."""

    def __init__(self, config: Open3dConfig | None = None) -> None:
        """Load Open3D; raises ImportError where it is not installed."""
        self.config = config or Open3dConfig()
        self._o3d: Any = importlib.import_module("open3d")
        self._o3d.utility.set_verbosity_level(self._o3d.utility.VerbosityLevel.Error)

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "open3d-fpfh-ransac"

    def prepare(self, scan: Scan) -> Described:
        """Thin the points and describe them."""
        features = extract_features(scan)
        normals = features.normals()
        usable = np.any(normals != 0.0, axis=1)
        points, normals = features.points[usable], normals[usable]
        cloud = self._o3d.geometry.PointCloud()
        if len(points) < 3:
            return Described(cloud, None, 0)
        level, up = math.cos(self.config.tilt), math.sin(self.config.tilt)
        cloud.points = self._vectors(np.column_stack([points, np.zeros(len(points))]))
        cloud.normals = self._vectors(np.column_stack([level * normals, np.full(len(points), up)]))
        cloud = cloud.voxel_down_sample(self.config.spacing)
        histograms = self._o3d.pipelines.registration.compute_fpfh_feature(
            cloud,
            self._o3d.geometry.KDTreeSearchParamHybrid(
                radius=self.config.feature_radius, max_nn=100
            ),
        )
        return Described(cloud, histograms, len(cloud.points))

    def match_prepared(self, reference: Described, current: Described) -> MatchResult:
        """Find T_reference_current."""
        if reference.size < 3 or current.size < 3:
            return nothing("fewer than three points with a normal in a scan")
        coarse = self._ransac(reference, current)
        if from_matrix(np.asarray(coarse.transformation)) is None:
            return nothing("the best motion in space is none in the plane")
        registration = self._o3d.pipelines.registration
        fine = registration.registration_icp(
            current.cloud,
            reference.cloud,
            self.config.refined_inlier,
            coarse.transformation,
            registration.TransformationEstimationPointToPoint(),
        )
        pose: Pose | None = from_matrix(np.asarray(fine.transformation))
        if pose is None or coarse.fitness <= 0.0:
            return nothing("no motion in the plane has inliers")
        checks = {"fitness": float(fine.fitness), "inlier_rmse": float(fine.inlier_rmse)}
        return hypothesis(pose, float(fine.fitness), self.config.least_score, checks=checks)

    def _ransac(self, reference: Described, current: Described) -> Any:
        """Run Open3D's RANSAC on matches of histograms, seeded."""
        registration = self._o3d.pipelines.registration
        self._o3d.utility.random.seed(self.config.seed)
        return registration.registration_ransac_based_on_feature_matching(
            current.cloud,
            reference.cloud,
            current.features,
            reference.features,
            True,
            self.config.inlier,
            registration.TransformationEstimationPointToPoint(False),
            3,
            [
                registration.CorrespondenceCheckerBasedOnEdgeLength(self.config.edge_length),
                registration.CorrespondenceCheckerBasedOnDistance(self.config.inlier),
                registration.CorrespondenceCheckerBasedOnNormal(math.radians(30.0)),
            ],
            registration.RANSACConvergenceCriteria(self.config.iterations, self.config.confidence),
        )

    def _vectors(self, rows: Any) -> Any:
        return self._o3d.utility.Vector3dVector(np.ascontiguousarray(rows))
