"""Algorithm 11: integrating the line segments of one scan into the local map (§5.8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lineloom_core.matching.thesis.config import Windows
from lineloom_core.matching.thesis.line_map import LineMap, MapLine, merge_all
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.pairs import Match
from lineloom_core.matching.thesis.parallel_relation import OVERLAP, ParallelRelations


@dataclass(frozen=True, eq=False)
class MapUpdate:
    """The new map, and the mapID of every line segment of L_c, (|L_c|,) by extraction number."""

    line_map: LineMap
    map_ids: tuple[int, ...]


def update_map(
    line_map: LineMap,
    matching_pairs: Sequence[Match],
    ids_r: Sequence[int],
    L_c: LineSegments,
    windows: Windows | None = None,
) -> MapUpdate:
    """Algorithm 11, UpdateMap.

    matching_pairs: (k, m), l_k in L_r and l_m in L_c. ids_r: the mapIDs of L_r, as an earlier
    update returned them. L_c: the current scan's lines, moved into the map's frame (the text: "L_c
    is aligned over L_r which was integrated into map").
    Departures: mapIDs are returned for L_c, or the next scan could not find its lines in the map;
    all merged lines are removed from the map, not one of them; the last loop, as printed, numbers
    the lines that have no match but never adds them; a line with a match in L_r may lie on further
    lines of the map as well, and joins them; lines of the map must also face the same way
    (beta about 0), or both faces of a thin wall would become one.
    Raises KeyError where ids_r names a line that the map never had.
    """
    windows = windows or Windows()
    if len(line_map) == 0:
        matching_pairs = []
    ids: dict[int, int] = {}
    for k, m in matching_pairs:  # common line segments of L_c and L_r
        common = line_map.current_id(ids_r[k])
        line_map, ids[m] = _integrated(line_map, L_c, m, {common}, windows)
    for i in range(len(L_c)):  # no match in L_r: one in the map, or a line of its own
        if i not in ids:
            line_map, ids[i] = _integrated(line_map, L_c, i, set(), windows)
    return MapUpdate(line_map, tuple(line_map.current_id(ids[i]) for i in range(len(L_c))))


def _integrated(
    line_map: LineMap, L_c: LineSegments, i: int, common: set[int], windows: Windows
) -> tuple[LineMap, int]:
    """Merge l_i with the map's lines of mapIDs `common` and all it lies on, or add it (MergeAll).

    Raises KeyError where the map has no line of such a mapID.
    """
    same = sorted(common.union(lines_on(line_map, L_c, i, windows)))
    own = MapLine.of(L_c, i, line_map.next_id)
    merged = merge_all([own, *(line_map.lines[q] for q in same)])
    return line_map.with_merged(merged, same), merged.map_id


def lines_on(line_map: LineMap, L_c: LineSegments, i: int, windows: Windows) -> list[int]:
    """MapIDs of the lines that l_i lies on: parallel, o(i,k) = overlap and d^v about 0 (§4.4)."""
    if len(line_map) == 0:
        return []
    on_map, ids = line_map.segments()
    both = _one_before(L_c, i, on_map)
    others = np.arange(1, len(both))
    relations = ParallelRelations.between(both, np.zeros_like(others), others, windows)
    same = (
        (np.cos(relations.beta) > 0.0)
        & (relations.o == OVERLAP)
        & (relations.d_v <= windows.distance)
    )
    return [ids[k - 1] for k in relations.lines[same, 1].tolist()]


def _one_before(L: LineSegments, i: int, others: LineSegments) -> LineSegments:
    """Line i of `L` followed by all of `others`."""
    return replace(
        others,
        s=np.vstack([L.s[i], others.s]),
        e=np.vstack([L.e[i], others.e]),
        s_is_edge=np.append(L.s_is_edge[i], others.s_is_edge),
        e_is_edge=np.append(L.e_is_edge[i], others.e_is_edge),
        first=np.append(L.first[i], others.first),
        last=np.append(L.last[i], others.last),
    )
