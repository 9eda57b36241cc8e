"""A path and a map from scans alone: each scan matched to the one before (§6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.matching.result import MatchResult
from lineloom_core.matching.thesis.line_map import LineMap
from lineloom_core.matching.thesis.map_update import update_map
from lineloom_core.scan import Scan
from numpy.typing import NDArray

from lineloom_lab.evaluation.error_area import ErrorArea
from lineloom_lab.experiments.contestant import Contestant, answer_of


@dataclass(frozen=True, eq=False)
class Chain:
    """What a matcher makes of n scans.

    poses: estimated T_world_laser, n; the first is given. results, areas: one per consecutive
    pair, n - 1; the area is None where there was no answer. line_map: by Algorithm 11, in the
    world frame.
    """

    poses: tuple[Pose, ...]
    results: tuple[MatchResult, ...]
    areas: tuple[ErrorArea | None, ...]
    line_map: LineMap

    @property
    def unanswered(self) -> int:
        """Pairs to which there was no answer at all; the path stands still there."""
        return sum(area is None for area in self.areas)

    @property
    def doubted(self) -> int:
        """Pairs whose answer the matcher itself did not call a match."""
        return sum(r.verdict != "match" for r in self.results)

    @property
    def percentages(self) -> NDArray[np.float64]:
        """Error area percentage of each pair, (n - 1,), NaN where there is none (§6.3)."""
        return np.array([np.nan if a is None else a.percentage for a in self.areas])

    @property
    def error_areas(self) -> NDArray[np.float64]:
        """Error area of each pair, (n - 1,) [m^2], NaN where there is none (§6.3)."""
        return np.array([np.nan if a is None else a.error for a in self.areas])

    def map_segments(self) -> NDArray[np.float64]:
        """The map's line segments, (k, 4) [m] in the world frame."""
        L, _ = self.line_map.segments()
        return np.hstack([L.s, L.e])


def match_chain(contestant: Contestant, scans: Sequence[Scan], start: Pose) -> Chain:
    """Match (S_i, S_i+1) for all i and chain the answers from `start`, T_world_laser of S_0.

    Every answer is used, whatever its verdict, as Algorithm 5 never declines; where there is none
    the pose is kept. The map grows by Algorithm 11, for either matcher from its own line segments
    and pairs.
    """
    matcher = contestant.matcher
    reference = matcher.prepare(scans[0])
    update = update_map(LineMap(), [], [], contestant.segments(reference).moved(start))
    poses, results = [start], []
    areas: list[ErrorArea | None] = []
    for scan in scans[1:]:
        current = matcher.prepare(scan)
        result = matcher.match_prepared(reference, current)
        step = answer_of(result)
        poses.append(poses[-1] @ (step or Pose.identity()))
        results.append(result)
        areas.append(None if step is None else contestant.area(reference, current, result, step))
        update = update_map(
            update.line_map,
            [] if step is None else [(p.reference, p.current) for p in result.pairs],
            update.map_ids,
            contestant.segments(current).moved(poses[-1]),
        )
        reference = current
    return Chain(tuple(poses), tuple(results), tuple(areas), update.line_map)
