"""The local map: line segments with mapIDs, fused from many scans (§5.8)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineloom_core.matching.thesis.line_segments import LineSegments


@dataclass(frozen=True, eq=False)
class MapLine:
    """One line segment of the map.

    s, e: (2,) [m] in the map's frame, free side left. s_is_edge, e_is_edge: was the end seen as
    an edge point? mass: metres of line segment observed in all; centre: (2,) [m] their centroid;
    scatter: (2, 2) [m^3] their second moments about it. map_id: the text's mapID.
    """

    map_id: int
    s: NDArray[np.float64]
    e: NDArray[np.float64]
    s_is_edge: bool
    e_is_edge: bool
    mass: float
    centre: NDArray[np.float64]
    scatter: NDArray[np.float64]

    @staticmethod
    def of(L: LineSegments, i: int, map_id: int) -> MapLine:
        """Make line i of `L`, given in the map's frame, a line of the map."""
        s, e = L.s[i], L.e[i]
        length = float(L.lengths[i])
        return MapLine(
            map_id,
            s,
            e,
            bool(L.s_is_edge[i]),
            bool(L.e_is_edge[i]),
            length,
            0.5 * (s + e),
            np.outer(e - s, e - s) * (length / 12.0),
        )


@dataclass(frozen=True, eq=False)
class LineMap:
    """The map: lines by mapID, and what mapIDs of lines that were merged away stand for now."""

    lines: Mapping[int, MapLine] = field(default_factory=dict)
    renamed: Mapping[int, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.lines)

    @property
    def next_id(self) -> int:
        """A mapID that no line has or had, from 1."""
        return 1 + max((*self.lines, *self.renamed), default=0)

    def current_id(self, map_id: int) -> int:
        """The mapID under which the line once called `map_id` is found now."""
        while map_id in self.renamed:
            map_id = self.renamed[map_id]
        return map_id

    def with_merged(self, line: MapLine, merged_ids: Iterable[int]) -> LineMap:
        """Return the map with `line` in place of all of `merged_ids`."""
        gone = set(merged_ids)
        kept = {i: old for i, old in self.lines.items() if i not in gone}
        renamed = {**self.renamed, **{i: line.map_id for i in gone if i != line.map_id}}
        return LineMap({**kept, line.map_id: line}, renamed)

    def segments(self) -> tuple[LineSegments, list[int]]:
        """All lines by ascending mapID, in the map's frame, and those mapIDs."""
        ids = sorted(self.lines)
        rows = [self.lines[i] for i in ids]
        return (
            LineSegments.of(
                [[*line.s, *line.e] for line in rows],
                [(line.s_is_edge, line.e_is_edge) for line in rows],
            ),
            ids,
        )


def merge_all(lines: Iterable[MapLine]) -> MapLine:
    """Merge (two lines) and MergeAll (any number) of Algorithm 11, which the text leaves open.

    The line of total least squares through all that was observed, every metre of line segment
    with the same weight, by summed moments, so that the order of merging does not matter; it
    reaches as far as any of the lines. The lowest mapID stays. Raises ValueError for no lines.
    """
    parts = list(lines)
    if not parts:
        raise ValueError("no lines to merge")
    mass = math.fsum(p.mass for p in parts)
    centre = sum((p.mass * p.centre for p in parts), np.zeros(2)) / mass
    scatter = np.zeros((2, 2))
    for p in parts:
        scatter += p.scatter + p.mass * np.outer(p.centre - centre, p.centre - centre)
    theta = 0.5 * math.atan2(2.0 * scatter[0, 1], scatter[0, 0] - scatter[1, 1])
    u = np.array([math.cos(theta), math.sin(theta)])
    if float(u @ sum((p.e - p.s for p in parts), np.zeros(2))) < 0.0:
        u = -u
    first = min(parts, key=lambda p: float(u @ p.s))
    last = max(parts, key=lambda p: float(u @ p.e))
    return MapLine(
        min(p.map_id for p in parts),
        centre + u * float(u @ (first.s - centre)),
        centre + u * float(u @ (last.e - centre)),
        first.s_is_edge,
        last.e_is_edge,
        mass,
        centre,
        scatter,
    )
