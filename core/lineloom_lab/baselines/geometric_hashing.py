"""Geometric hashing of points and their surroundings: thesis §2.2.5, [26].

[26] M. Tomono, "A scan matching method using Euclidean invariant signature for global localization
and map building", ICRA 2004, after [29] H. J. Wolfson and I. Rigoutsos, "Geometric hashing: an
overview", IEEE Computational Science and Engineering 4(4), 1997. Every point of a surface, with its
tangent, is a basis; where the points around it lie in that basis is its signature, which no rigid
motion changes. Signatures find one another through a hash table, every pair of like bases gives a
motion, and the motions vote in Hough space.

Needs no guess, but the surroundings of a point must be seen alike from both places.

Departures: the paper hashes a few differential invariants; we hash the quantised places of the
neighbouring points themselves, as [29] does, and let rare cells count more (inverse document
frequency), or the points along straight walls outvote everything; the Hough space is not a grid but
the votes themselves, each counting its neighbours, so that no cell border splits a peak.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from lineloom_core.features import ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.result import MatchResult
from lineloom_core.scan import Scan
from numpy.typing import NDArray
from scipy import sparse

from lineloom_lab.baselines.answer import hypothesis, nothing
from lineloom_lab.baselines.rigid_motion import motion_of_points

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GeometricHashingConfig:
    """Parameters; metres, radians, shares 0..1.

    spacing: distance of neighbouring bases on a surface. radius: of the surroundings in a
    signature. cell: side of a hash cell. likest: reference bases that each current basis votes
    with. least_likeness: of two signatures that vote. vote_distance, vote_angle: votes nearer than
    that are for the same motion. least_votes: for a peak. least_score: from which on the verdict
    is "match".
    """

    spacing: float = 0.15
    radius: float = 3.0
    cell: float = 0.25
    likest: int = 4
    least_likeness: float = 0.2
    vote_distance: float = 0.3
    vote_angle: float = math.radians(6.0)
    least_votes: int = 4
    least_score: float = 0.43
    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)


@dataclass(frozen=True, eq=False)
class Bases:
    """Points of surfaces with tangents, and their signatures.

    places: (n, 2) [m]. directions: (n,) of the tangents, free side on the left [rad]. table:
    (n, cells) sparse, 1 where a basis sees a point in that cell: row by row the signatures, column
    by column the hash table.
    """

    places: Array
    directions: Array
    table: sparse.csr_matrix

    def __len__(self) -> int:
        return len(self.directions)


class GeometricHashingMatcher:
    """Tomono's signatures with Wolfson's voting."""

    def __init__(self, config: GeometricHashingConfig | None = None) -> None:
        self.config = config or GeometricHashingConfig()

    @property
    def name(self) -> str:
        """Short name for tables."""
        return "geometric-hashing"

    def prepare(self, scan: Scan) -> Bases:
        """Choose the bases of a scan and hash their surroundings."""
        features = extract_features(scan, self.config.extraction)
        chosen = _spaced(features, self.config.spacing)
        normals = features.normals()[chosen]
        has_normal = np.any(normals != 0.0, axis=1)
        places, normals = features.points[chosen][has_normal], normals[has_normal]
        # The normal points to the free side, the tangent keeps it on its left.
        directions = np.arctan2(-normals[:, 0], normals[:, 1])
        return Bases(places, directions, self._signatures(places, directions))

    def match_prepared(self, reference: Bases, current: Bases) -> MatchResult:
        """Find T_reference_current."""
        least = self.config.least_votes
        if len(reference) < least or len(current) < least:
            return nothing(f"fewer than {least} points with a tangent in a scan")
        i, j, weights = self._votes(reference, current)
        if len(i) < least:
            return nothing("no two points have like surroundings")
        theta = wrap_array(reference.directions[i] - current.directions[j])
        c, s = np.cos(theta), np.sin(theta)
        p, q = reference.places[i], current.places[j]
        x, y = p[:, 0] - (c * q[:, 0] - s * q[:, 1]), p[:, 1] - (s * q[:, 0] + c * q[:, 1])
        near = (np.abs(wrap_array(theta[:, None] - theta[None, :])) < self.config.vote_angle) & (
            np.hypot(x[:, None] - x, y[:, None] - y) < self.config.vote_distance
        )
        support = near @ weights
        members = np.flatnonzero(near[int(np.argmax(support))])
        voters = np.unique(j[members])
        if len(voters) < least:
            return nothing(f"no motion has {least} votes")
        pose = motion_of_points(q[members], p[members], weights[members])
        return hypothesis(
            pose,
            len(voters) / min(len(reference), len(current)),
            self.config.least_score,
            checks={"votes": float(support.max()), "voters": float(len(voters))},
        )

    def _signatures(self, places: Array, directions: Array) -> sparse.csr_matrix:
        """Hash the places of all points within the radius in each basis's own frame."""
        radius, cell = self.config.radius, self.config.cell
        side = 2 * math.ceil(radius / cell) + 1
        offset = places[None, :, :] - places[:, None, :]
        c, s = np.cos(directions)[:, None], np.sin(directions)[:, None]
        u = c * offset[:, :, 0] + s * offset[:, :, 1]
        v = c * offset[:, :, 1] - s * offset[:, :, 0]
        inside = np.hypot(u, v) <= radius
        # Cell borders lie off the basis's own wall, whose points jitter about v = 0.
        column = np.floor(u / cell + 0.5).astype(np.int64) + side // 2
        row = np.floor(v / cell + 0.5).astype(np.int64) + side // 2
        seen = np.zeros((len(places), side * side), dtype=np.bool_)
        basis, _ = np.nonzero(inside)
        seen[basis, (row * side + column)[inside]] = True
        return sparse.csr_matrix(seen, dtype=np.float64)

    def _votes(
        self, reference: Bases, current: Bases
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """Look current signatures up in the reference's table: bases i, j and their likeness."""
        known = np.asarray(reference.table.sum(axis=0)).ravel()
        rarity = np.log((1.0 + len(reference)) / (1.0 + known))
        r = reference.table.multiply(np.sqrt(rarity)).tocsr()
        c = current.table.multiply(np.sqrt(rarity)).tocsr()
        common = np.asarray((r @ c.T).todense())
        sizes = np.outer(
            np.asarray(r.multiply(r).sum(axis=1)).ravel(),
            np.asarray(c.multiply(c).sum(axis=1)).ravel(),
        )
        likeness = common / np.sqrt(np.maximum(sizes, 1e-12))
        count = min(self.config.likest, len(reference))
        i = np.argsort(-likeness, axis=0, kind="stable")[:count].ravel()
        j = np.tile(np.arange(len(current)), count)
        kept = likeness[i, j] >= self.config.least_likeness
        i, j = i[kept], j[kept]
        return i, j, np.asarray(likeness[i, j], dtype=np.float64)


def _spaced(features: ScanFeatures, spacing: float) -> NDArray[np.int64]:
    """Points about `spacing` metres apart along each surface, the first of each included."""
    points = features.points
    if len(points) == 0:
        return np.zeros(0, dtype=np.int64)
    steps = np.concatenate([[0.0], np.linalg.norm(np.diff(points, axis=0), axis=1)])
    starts = np.concatenate([[True], features.breaks[:-1]])
    along = np.cumsum(np.where(starts, 0.0, steps))
    surface = np.cumsum(starts)
    origin = along[np.flatnonzero(starts)][surface - 1]
    stop = np.floor((along - origin) / spacing)
    new = starts | (np.diff(stop, prepend=-1.0) > 0)
    return np.flatnonzero(new)
