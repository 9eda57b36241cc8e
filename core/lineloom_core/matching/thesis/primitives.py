"""The geometrical primitives of one scan (chapter 3)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose
from lineloom_core.matching.thesis.config import PrimitiveConfig
from lineloom_core.matching.thesis.edge_extraction import (
    Sweep,
    angle_edges,
    jump_edges,
    virtual_edges,
    with_edge_points,
)
from lineloom_core.matching.thesis.edges import Edges
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.split_and_merge import split_and_merge
from lineloom_core.scan import Scan


@dataclass(frozen=True, eq=False)
class Primitives:
    """The line segments L and the edges E of one scan, in the laser's frame (Table 3.1).

    full_turn: the scan closes, so that extraction order has no beginning.
    """

    L: LineSegments
    E: Edges
    full_turn: bool = False

    def moved(self, T_target_laser: Pose) -> Primitives:
        """Return the same primitives in another frame; their relations stay the same."""
        return replace(self, L=self.L.moved(T_target_laser), E=self.E.moved(T_target_laser))


def extract_primitives(scan: Scan, config: PrimitiveConfig | None = None) -> Primitives:
    """Extract line segments and edges of one scan (chapter 3)."""
    config = config or PrimitiveConfig()
    scan = scan.counter_clockwise()  # extraction order is counter-clockwise (§3.1.1)
    sweep = Sweep.of(scan)
    points, beams = transform_to_points(scan)  # §3.1.3
    lines = split_and_merge(points, beams, scan.angle_increment, config)  # §3.2, Algorithm 1
    return _with_edges(lines, sweep, config)  # §3.2 end points, §3.3 edges


def transform_to_points(scan: Scan) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """p_i = r_i (cos a_i, sin a_i) (§3.1.3): points (n, 2) [m] and their beam indices (n,).

    Departures: a_i = angle_min + i angle_increment, for any lidar; beams without return have none.
    """
    beams = np.flatnonzero(np.isfinite(scan.ranges))
    r, a = scan.ranges[beams], scan.angles[beams]
    return np.column_stack([r * np.cos(a), r * np.sin(a)]), beams


def primitives_of_features(
    features: ScanFeatures, config: PrimitiveConfig | None = None
) -> Primitives:
    """Take the default matcher's line segments, to compare the two extractions; edges as above."""
    config = config or PrimitiveConfig()
    sweep = Sweep(features.ranges, features.angle_min, features.angle_increment)
    beams = features.lines[:, 10:12].astype(np.int64)
    return _with_edges(LineSegments.of(features.lines[:, :4], beams=beams), sweep, config)


def _with_edges(lines: LineSegments, sweep: Sweep, config: PrimitiveConfig) -> Primitives:
    corners = angle_edges(lines, sweep, config)  # §3.3
    jumps = jump_edges(lines, sweep, corners, config)
    L = with_edge_points(lines, corners, jumps)  # §3.2: edge points and interior points
    found = [corners, jumps]
    if config.virtual_edges:
        found.append(virtual_edges(L, corners, config))
    return Primitives(L, Edges.joined(found), sweep.full_turn)
