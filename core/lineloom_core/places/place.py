"""A place: a few metres of one robot's way, as place recognition sees it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import EDGE, ScanFeatures
from lineloom_core.features._kernels import (
    LENGTH,
    LINE_COLUMNS,
    OFFSET,
    THETA,
    VAR_OFFSET,
    VAR_THETA,
)
from lineloom_core.fusion import LineObservations, fuse
from lineloom_core.geometry import Pose
from lineloom_core.lately import UsedLately
from lineloom_core.matching._free_space_kernels import CONFLICT, judge_cloud
from lineloom_core.matching.free_space import TOLERANCE, TOLERANCE_SLOPE
from lineloom_core.matching.local_map import Cloud, LocalMap, Registration
from lineloom_core.places import _kernels
from lineloom_core.places.landmarks import find_landmarks

PLACE_GATE = 0.3
"""How far from where they are expected points may be found in another place [m]."""

_SIGMA = 0.04  # m: of averaged points that drift has moved against each other

_CORNER_REACH = 0.15


_BODIES_KEPT = 768
"""Places whose arrays stay in memory, about 0.15 MB each; another one's are made in 1 ms."""


class Sight(Protocol):
    """A scan as a place takes it: a keyframe, or `Seen`."""

    @property
    def features(self) -> ScanFeatures:
        """Its lines, ends, edges and ranges."""

    @property
    def cloud(self) -> Cloud:
        """Its points with normals."""


@dataclass(frozen=True, eq=False)
class Seen:
    """A scan that is no keyframe."""

    features: ScanFeatures
    cloud: Cloud


@dataclass(frozen=True, eq=False, slots=True)
class Glimpse:
    """One keyframe's contribution to a place: what it saw and where it stood."""

    keyframe: int
    sight: Sight
    T_anchor_laser: Pose


@dataclass(frozen=True, eq=False)
class Body:
    """The arrays of a place (see there): a function of its glimpses."""

    lines: NDArray[np.float64]
    ends: NDArray[np.int64]
    edges: NDArray[np.float64]
    surface: Cloud
    local_map: LocalMap
    ranges: NDArray[np.float64]
    angle_mins: NDArray[np.float64]
    angle_increments: NDArray[np.float64]
    sweep_poses: NDArray[np.float64]

    @cached_property
    def landmarks(self) -> NDArray[np.float64]:
        """See `Place.landmarks`."""
        return find_landmarks(self.surface.points, self.lines, self.ends, self.edges)

    @cached_property
    def steady(self) -> NDArray[np.bool_]:
        """See `Place.steady`."""
        tally = _tally(self, self.surface.points, Pose.identity())
        hits, misses = tally[:, 0], tally[:, 1]
        still: NDArray[np.bool_] = (hits >= 2) & (misses <= 0.25 * hits)
        return still


@dataclass(frozen=True, eq=False)
class Place:
    """Glimpses of consecutive keyframes as one piece of map, in the frame of its anchor keyframe.

    Its arrays are made when they are asked for, and kept for the places used last: a building has
    many more places than are compared at a time.
    """

    id: int
    track: int
    anchor: int
    glimpses: tuple[Glimpse, ...]

    @property
    def keyframes(self) -> tuple[int, ...]:
        """Ids of its keyframes, in their order."""
        return tuple(g.keyframe for g in self.glimpses)

    @property
    def poses(self) -> tuple[Pose, ...]:
        """T_anchor_laser of its keyframes."""
        return tuple(g.T_anchor_laser for g in self.glimpses)

    @property
    def lines(self) -> NDArray[np.float64]:
        """Fused oriented lines as `ScanFeatures` has them, shape (n, 12)."""
        return _body(self).lines

    @property
    def ends(self) -> NDArray[np.int64]:
        """What their ends are, as `ScanFeatures` has it, shape (n, 2)."""
        return _body(self).ends

    @property
    def edges(self) -> NDArray[np.float64]:
        """Where the corners at their ends are, shape (n, 2, 2)."""
        return _body(self).edges

    @property
    def surface(self) -> Cloud:
        """The averaged points."""
        return _body(self).surface

    @property
    def local_map(self) -> LocalMap:
        """The averaged points, to register against."""
        return _body(self).local_map

    def register(self, other: Place, T: Pose) -> Registration:
        """Refine T_self_other on the averaged points, from which drift may have moved it."""
        return self.local_map.register(other.surface, T, gate=PLACE_GATE, sigma=_SIGMA)

    @property
    def ranges(self) -> NDArray[np.float64]:
        """The sweeps for free-space checks, shape (k, b), padded with NaN."""
        return _body(self).ranges

    @property
    def angle_mins(self) -> NDArray[np.float64]:
        """Angle of the sweeps' first beams [rad], shape (k,)."""
        return _body(self).angle_mins

    @property
    def angle_increments(self) -> NDArray[np.float64]:
        """Angle between the sweeps' beams [rad], shape (k,)."""
        return _body(self).angle_increments

    @property
    def sweep_poses(self) -> NDArray[np.float64]:
        """Where the sweeps were taken: x, y, theta, shape (k, 3)."""
        return _body(self).sweep_poses

    @property
    def landmarks(self) -> NDArray[np.float64]:
        """Its objects and corners as `find_landmarks` has them, shape (n, 5)."""
        return _body(self).landmarks

    @property
    def steady(self) -> NDArray[np.bool_]:
        """Which surface points stood still, shape (n,): seen twice, and hardly ever seen through.

        People walk and doors move while a robot passes; walls, furniture and columns do not.
        """
        return _body(self).steady

    @cached_property
    def own_conflict(self) -> float:
        """Share of the place's own points in its own free space: clutter, people, drift inside."""
        matched, conflict = count_points(self, self, Pose.identity())
        return conflict / max(matched + conflict, 1.0)


def _make_body(place: Place) -> Body:
    """Fuse a place's glimpses."""
    sights = [(g.sight, g.T_anchor_laser) for g in place.glimpses]
    features = [sight.features for sight, _ in sights]
    local_map = LocalMap.build(
        ((sight.cloud, T) for sight, T in sights), reach=20.0, searchable=False
    )
    lines, ends, edges = _fuse_lines(place.glimpses)
    ranges = np.full((len(features), max(len(f.ranges) for f in features)), np.nan)
    for k, f in enumerate(features):
        ranges[k, : len(f.ranges)] = f.ranges
    return Body(
        lines=lines,
        ends=ends,
        edges=edges,
        surface=_surface_cloud(local_map),
        local_map=local_map,
        ranges=ranges,
        angle_mins=np.array([f.angle_min for f in features]),
        angle_increments=np.array([f.angle_increment for f in features]),
        sweep_poses=np.array([T.to_array() for _, T in sights]),
    )


_body = UsedLately[Place, Body](_make_body, _BODIES_KEPT)


def count_points(
    reference: Place, current: Place, T_reference_current: Pose
) -> tuple[float, float]:
    """Points (cells of 0.1 m) that both places saw, and those in the other's free space."""
    hits, misses = np.concatenate(_both_tallies(reference, current, T_reference_current)).T
    matched = (hits > 0) & (hits >= misses)
    return float(np.count_nonzero(matched)), float(np.count_nonzero(~matched & (misses > 0)))


def share_explained(reference: Place, current: Place, T_reference_current: Pose) -> float:
    """Share of the current place's points that the reference saw as well, 0..1."""
    counts = np.zeros(4)
    judge_cloud(
        current.surface.points, 1, T_reference_current.to_array(), reference.ranges,
        reference.angle_mins, reference.angle_increments, reference.sweep_poses,
        TOLERANCE, TOLERANCE_SLOPE, counts,
    )  # fmt: skip
    return float(counts[0]) / max(len(current.surface.points), 1)


def count_steady(reference: Place, current: Place, T_reference_current: Pose) -> tuple[int, int]:
    """Steady points of either place that the other saw as well, and those it saw through.

    Seen through means by two sweeps at least, and by three times as many as measured it: what
    stood still for one robot and was not there for the other. Two views of one room differ by a
    door or a chair; two rooms that look alike differ by all that stands in them.
    """
    current_in, reference_in = count_steady_each_way(reference, current, T_reference_current)
    return current_in[0] + reference_in[0], current_in[1] + reference_in[1]


def count_steady_each_way(
    reference: Place, current: Place, T_reference_current: Pose
) -> tuple[tuple[int, int], tuple[int, int]]:
    """`count_steady` of the current place's points in the reference, and the other way round."""
    there, here = _both_tallies(reference, current, T_reference_current)
    return _seen_and_gone(there[current.steady]), _seen_and_gone(here[reference.steady])


def _seen_and_gone(tally: NDArray[np.float64]) -> tuple[int, int]:
    hits, misses = tally.T
    matched = np.count_nonzero((hits > 0) & (hits >= misses))
    return int(matched), int(np.count_nonzero((misses >= 2) & (misses >= 3 * hits)))


@lru_cache(maxsize=1)  # recognition asks for both counts of one pair at one pose
def _both_tallies(
    reference: Place, current: Place, T_reference_current: Pose
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`_tally` of the current place's points in the reference, and of the reference's in it."""
    there = _tally(reference, current.surface.points, T_reference_current)
    return there, _tally(current, reference.surface.points, T_reference_current.inverse())


def _tally(
    place: Place | Body, points: NDArray[np.float64], T_place_points: Pose
) -> NDArray[np.float64]:
    """Sweeps of the place that measured each point and that saw through it, shape (n, 2)."""
    out = np.empty((len(points), 2))
    _kernels.tally_sweeps(
        points, T_place_points.to_array(), place.ranges, place.angle_mins, place.angle_increments,
        place.sweep_poses, TOLERANCE, TOLERANCE_SLOPE, out,
    )  # fmt: skip
    return out


def conflicting_points(
    reference: Place, current: Place, T_reference_current: Pose
) -> NDArray[np.float64]:
    """Points (n, 2) of `current`, in its own frame, that stand in free space of `reference`."""
    points = current.surface.points
    pose = T_reference_current.to_array()
    conflict = np.zeros(len(points), dtype=np.bool_)
    for i in range(len(points)):
        counts = np.zeros(4)
        judge_cloud(
            points[i : i + 1], 1, pose, reference.ranges, reference.angle_mins,
            reference.angle_increments, reference.sweep_poses, TOLERANCE, TOLERANCE_SLOPE, counts,
        )  # fmt: skip
        conflict[i] = counts[CONFLICT] > 0.0
    found: NDArray[np.float64] = points[conflict]
    return found


def _surface_cloud(local_map: LocalMap) -> Cloud:
    surface = local_map.surface
    points = np.ascontiguousarray(surface[:, :2])
    normals = np.ascontiguousarray(surface[:, 2:4])
    return Cloud(points, normals, np.ones(len(points)), points[::4].copy())


def _fuse_lines(
    glimpses: Sequence[Glimpse],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Fused lines of a place with the corners that any of its scans saw at their ends."""
    segments, sigmas, keyframes = [], [], []
    corners: tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]] = ([], [])
    for g in glimpses:
        f = g.sight.features
        ends = g.T_anchor_laser.transform(f.lines[:, :4].reshape(-1, 2)).reshape(-1, 4)
        segments.append(ends)
        sigmas.append(np.sqrt(f.lines[:, VAR_OFFSET]))
        keyframes.append(np.full(len(f), g.keyframe, dtype=np.int64))
        for side in range(2):
            seen = f.edges[f.ends[:, side] == EDGE, side]
            corners[side].append(g.T_anchor_laser.transform(seen))
    observed = np.concatenate(segments)
    n = len(observed)
    fused = fuse(
        LineObservations(
            endpoints=observed,
            sigma=np.concatenate(sigmas),
            weight=np.ones(n),
            keyframe=np.concatenate(keyframes),
            robot=np.zeros(n, dtype=np.int64),
            stamp=np.zeros(n),
            id=np.arange(n, dtype=np.int64),
        )
    )
    return _as_line_rows(fused.endpoints, fused.sigma, corners)


def _as_line_rows(
    endpoints: NDArray[np.float64],
    sigma: NDArray[np.float64],
    corners: tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    n = len(endpoints)
    lines = np.zeros((n, LINE_COLUMNS))
    direction = endpoints[:, 2:] - endpoints[:, :2]
    length = np.hypot(direction[:, 0], direction[:, 1])
    unit = direction / np.maximum(length, 1e-9)[:, None]
    middle = 0.5 * (endpoints[:, 2:] + endpoints[:, :2])
    lines[:, :4] = endpoints
    lines[:, THETA] = np.arctan2(direction[:, 1], direction[:, 0])
    lines[:, OFFSET] = unit[:, 0] * middle[:, 1] - unit[:, 1] * middle[:, 0]
    lines[:, LENGTH] = length
    lines[:, VAR_OFFSET] = sigma**2
    lines[:, VAR_THETA] = 12.0 * sigma**2 / np.maximum(length, 0.1) ** 2
    ends = np.zeros((n, 2), dtype=np.int64)
    edges = endpoints.reshape(n, 2, 2).copy()
    for side in range(2):
        seen = np.concatenate(corners[side]) if corners[side] else np.empty((0, 2))
        if n and len(seen):
            d = np.linalg.norm(edges[:, side, None, :] - seen[None, :, :], axis=2)
            ends[d.min(axis=1) < _CORNER_REACH, side] = EDGE
    return lines, ends, edges
