"""The maximum common subgraph of two feature sets: thesis §2.2.3, [5].

[5] T. Bailey, E. M. Nebot, J. K. Rosenblatt and H. F. Durrant-Whyte, "Data association for mobile
robot navigation: a graph theoretic approach", ICRA 2000. Features (points and lines) are the nodes
of a graph whose edges are their relative geometry; a node of the correspondence graph is a pair of
features of one kind, joined to another where the relative geometry of both scans agrees; its
maximum clique is the largest set of features common to both.

Needs no guess.

Departures: exact cliques can grow exponentially, so only the `most_lines` longest lines and
`most_points` nearest corners enter, and the search stops after `most_cliques` maximal cliques
(networkx's enumeration; what it had found by then counts). Lines are oriented, so angles
run over the full turn. A clique of parallel lines alone fixes no translation and is passed over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import islice

import networkx as nx
import numpy as np
from lineloom_core.features import EDGE, ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.geometry import Pose, circular_mean
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.baselines.answer import hypothesis, nothing
from lineloom_lab.baselines.rigid_motion import shift_of_constraints

Array = NDArray[np.float64]
Pairs = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class CommonSubgraphConfig:
    """Parameters; metres, radians, shares 0..1.

    most_lines, most_points, most_cliques: bounds of the search. distance, angle: greatest
    differences of two relations taken for equal. same_point: corners nearer than this are one.
    least_clique: features that must be common. least_score: from which on the verdict is "match".
    """

    most_lines: int = 14
    most_points: int = 24
    most_cliques: int = 5000
    distance: float = 0.12
    angle: float = math.radians(4.0)
    same_point: float = 0.1
    least_clique: int = 4
    least_score: float = 0.54
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)


@dataclass(frozen=True, eq=False)
class FeatureGraph:
    """Features and their relative geometry, which no rigid motion changes.

    points: (p, 2) corners and real wall ends [m]. lines: (n, 12) as `ScanFeatures.lines`.
    point_point: (p, p) distances [m]. line_line: (n, n, 2) angle from the row's line to the
    column's [rad] and, for parallel lines, their signed distance [m], else NaN. line_point: (n, p)
    signed distance of the point from the line [m].
    """

    points: Array
    lines: Array
    point_point: Array
    line_line: Array
    line_point: Array

    @staticmethod
    def of(points: Array, lines: Array, parallel: float) -> FeatureGraph:
        """Measure all relations; lines within `parallel` [rad] of one another have a distance."""
        normals = np.column_stack([-np.sin(lines[:, 4]), np.cos(lines[:, 4])])
        angles = wrap_array(lines[None, :, 4] - lines[:, None, 4])
        centres = 0.5 * (lines[:, 0:2] + lines[:, 2:4])
        across = normals @ centres.T - lines[:, 5][:, None]
        across = np.where(np.abs(np.sin(angles)) < math.sin(parallel), across, np.nan)
        return FeatureGraph(
            points,
            lines,
            np.linalg.norm(points[:, None, :] - points[None, :, :], axis=2),
            np.stack([angles, across], axis=2),
            normals @ points.T - lines[:, 5][:, None],
        )


class CommonSubgraphMatcher:
    """Bailey's maximum clique over feature correspondences."""

    def __init__(self, config: CommonSubgraphConfig | None = None) -> None:
        self.config = config or CommonSubgraphConfig()

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "common-subgraph"

    def prepare(self, scan: Scan) -> FeatureGraph:
        """Extract the features and measure their relations."""
        features = extract_features(scan, self.config.extraction)
        lines = features.lines
        longest = np.sort(np.argsort(-lines[:, 6], kind="stable")[: self.config.most_lines])
        points = _corners(features, self.config.same_point)[: self.config.most_points]
        return FeatureGraph.of(points, lines[longest], 2.0 * self.config.angle)

    def match_prepared(self, reference: FeatureGraph, current: FeatureGraph) -> MatchResult:
        """Find T_reference_current."""
        if len(reference.lines) < 2 or len(current.lines) < 2:
            return nothing("fewer than two line segments in a scan")
        lines, points, agrees = self._correspondences(reference, current)
        best: tuple[int, float, Pose] | None = None
        # Ties between cliques go to the smaller residual, then to the one found first.
        for clique in islice(
            nx.find_cliques(nx.from_numpy_array(agrees)), self.config.most_cliques
        ):
            if len(clique) < self.config.least_clique or (best and len(clique) < best[0]):
                continue
            chosen = np.sort(np.array(clique))
            line_pairs = lines[chosen[chosen < len(lines)]]
            point_pairs = points[chosen[chosen >= len(lines)] - len(lines)]
            fitted = _fit(reference, current, line_pairs, point_pairs)
            if fitted is None:
                continue
            pose, residual = fitted
            if best is None or (len(clique), -residual) > (best[0], -best[1]):
                best = len(clique), residual, pose
        if best is None:
            return nothing(f"no {self.config.least_clique} features are common to both scans")
        size, residual, pose = best
        smaller = min(
            len(reference.lines) + len(reference.points), len(current.lines) + len(current.points)
        )
        checks = {"clique": float(size), "residual": residual, "nodes": float(len(agrees))}
        return hypothesis(pose, size / smaller, self.config.least_score, checks=checks)

    def _correspondences(
        self, reference: FeatureGraph, current: FeatureGraph
    ) -> tuple[Pairs, Pairs, NDArray[np.bool_]]:
        """Pairs of lines (k, 2) and of points (l, 2), and which of the k + l agree with which."""
        lines = _all_pairs(len(reference.lines), len(current.lines))
        points = _all_pairs(len(reference.points), len(current.points))
        k = len(lines)
        agrees = np.zeros((k + len(points),) * 2, dtype=np.bool_)
        agrees[:k, :k] = self._lines_agree(reference, current, lines)
        i, j = points[:, 0], points[:, 1]
        apart = reference.point_point[np.ix_(i, i)] - current.point_point[np.ix_(j, j)]
        agrees[k:, k:] = (np.abs(apart) < self.config.distance) & _distinct(points)
        off = (
            reference.line_point[np.ix_(lines[:, 0], i)]
            - current.line_point[np.ix_(lines[:, 1], j)]
        )
        agrees[:k, k:] = np.abs(off) < self.config.distance
        agrees[k:, :k] = agrees[:k, k:].T
        return lines, points, agrees

    def _lines_agree(
        self, reference: FeatureGraph, current: FeatureGraph, lines: Pairs
    ) -> NDArray[np.bool_]:
        i, j = lines[:, 0], lines[:, 1]
        r, c = reference.line_line[np.ix_(i, i)], current.line_line[np.ix_(j, j)]
        turned = np.abs(wrap_array(r[:, :, 0] - c[:, :, 0])) < self.config.angle
        off = np.abs(r[:, :, 1] - c[:, :, 1])
        # A line that is parallel in one scan only (by a hair) has no distance to compare.
        near = ~(off > self.config.distance)
        return turned & turned.T & near & near.T & _distinct(lines)


def _corners(features: ScanFeatures, same_point: float) -> Array:
    """Return the edges of thesis §3.3, nearest first, each place once; (p, 2) [m]."""
    found = features.edges[features.ends == EDGE].reshape(-1, 2)
    order = np.argsort(np.hypot(found[:, 0], found[:, 1]), kind="stable")
    kept: list[Array] = []
    for point in found[order]:
        if all(math.dist(point, other) > same_point for other in kept):
            kept.append(point)
    return np.array(kept).reshape(-1, 2)


def _all_pairs(n: int, m: int) -> Pairs:
    return np.array([(i, j) for i in range(n) for j in range(m)], dtype=np.int64).reshape(-1, 2)


def _distinct(pairs: Pairs) -> NDArray[np.bool_]:
    """Tell which pairs share neither feature: each feature has at most one counterpart."""
    i, j = pairs[:, 0], pairs[:, 1]
    return np.asarray((i[:, None] != i[None, :]) & (j[:, None] != j[None, :]), dtype=np.bool_)


def _fit(
    reference: FeatureGraph, current: FeatureGraph, lines: Pairs, points: Pairs
) -> tuple[Pose, float] | None:
    """Least squares over a clique: pose and rms residual [m]; None where it stays loose."""
    r, c = reference.lines[lines[:, 0]], current.lines[lines[:, 1]]
    p, q = reference.points[points[:, 0]], current.points[points[:, 1]]
    angles, weights = [r[:, 4] - c[:, 4]], [np.minimum(r[:, 6], c[:, 6])]
    if len(p) >= 2:
        a, b = p - p.mean(axis=0), q - q.mean(axis=0)
        angles.append(np.arctan2(a[:, 1], a[:, 0]) - np.arctan2(b[:, 1], b[:, 0]))
        weights.append(np.sqrt(np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)))
    try:
        theta = circular_mean(np.concatenate(angles), np.concatenate(weights))
    except ValueError:
        return None
    turn = Pose(0.0, 0.0, theta)
    normals = np.column_stack([-np.sin(r[:, 4]), np.cos(r[:, 4])])
    centres = turn.transform(0.5 * (c[:, 0:2] + c[:, 2:4]))
    moved = turn.transform(q)
    rows = np.vstack([normals, np.tile([1.0, 0.0], (len(q), 1)), np.tile([0.0, 1.0], (len(q), 1))])
    offsets = np.concatenate(
        [r[:, 5] - np.sum(normals * centres, axis=1), p[:, 0] - moved[:, 0], p[:, 1] - moved[:, 1]]
    )
    found = shift_of_constraints(rows, offsets, np.ones(len(rows)))
    if found is None:
        return None
    residual = math.sqrt(float(np.mean((rows @ found[0] - offsets) ** 2)))
    return Pose(float(found[0][0]), float(found[0][1]), theta), residual
