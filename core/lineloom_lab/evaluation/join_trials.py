"""Sets of recognitions that would join two maps, with what is measured of them and the truth.

Steps of `trials`: 1. draw a fleet (`join_fleets`); 2. map its scans, joining nothing; 3. every so
often measure the best set between each two components as the mapper would; 4. call it true where
most of it holds to within 1 m and 15 degrees.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import JoinConfig, MapperConfig
from lineloom_core.mapping.merging.candidate_sets import (
    best_sets,
    candidates_between,
    solved_together,
)
from lineloom_core.mapping.merging.weighing import figures_at_once, figures_of_maps
from lineloom_core.mapping.site_mapper import SiteMapper

from lineloom_lab.evaluation.join_fleets import join_fleet
from lineloom_lab.evaluation.merge_bench_fleets import BenchFleet
from lineloom_lab.evaluation.merge_bench_judge import MOST_OFF_M, MOST_TURNED_RAD

_JOINS_NOTHING = MapperConfig(join=JoinConfig(least_set=4096))
_EVERY_SCANS = 110

Pair = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Trial:
    """One set at one time. pair: roots of the components; of one pair there are several trials."""

    kind: str
    seed: int
    pair: Pair
    figures: dict[str, float]
    false: bool


def trials(kind: str, seed: int) -> list[Trial]:
    """All trials of one fleet (steps 1 to 4)."""
    fleet = join_fleet(kind, seed)
    mapper, truth = SiteMapper(_JOINS_NOTHING), Truth(fleet)
    found: list[Trial] = []
    known: dict[Pair, int] = {}
    for count, sample in enumerate(fleet.scans(), start=1):
        truth.poses[sample.robot, sample.scan.seq] = sample.true_pose
        mapper.add(sample.robot, sample.scan)
        if count % _EVERY_SCANS == 0:
            found += (Trial(kind, seed, *row) for row in _new_sets(mapper, truth, known))
    return found + [Trial(kind, seed, *row) for row in _new_sets(mapper, truth, known)]


class Truth:
    """Where a fleet's scans were taken, and on which floor."""

    def __init__(self, fleet: BenchFleet) -> None:
        self.poses: dict[tuple[str, int], Pose] = {}
        self._floor: Mapping[str, int] = {robot.name: robot.floor for robot in fleet.robots}

    def holds(self, site: SiteMap, c: Constraint) -> bool:
        """Whether a constraint says what is true."""
        a, b = site.keyframes[c.keyframe_a], site.keyframes[c.keyframe_b]
        if self._floor[a.robot] != self._floor[b.robot]:
            return False
        true = self.poses[a.robot, a.scan.seq].between(self.poses[b.robot, b.scan.seq])
        turned = abs(angle_difference(true.theta, c.T_a_b.theta))
        return true.distance(c.T_a_b) <= MOST_OFF_M and bool(turned <= MOST_TURNED_RAD)


def _new_sets(
    mapper: SiteMapper, truth: Truth, known: dict[Pair, int]
) -> Iterator[tuple[Pair, dict[str, float], bool]]:
    """What came up since it was last asked for; known: candidates by pair, brought up to date."""
    site = mapper._site
    counts: dict[Pair, int] = {}
    for c in site.constraints.values():
        if c.kind == "rendezvous" and c.state == "candidate":
            roots = sorted(site.component_root(k) for k in (c.keyframe_a, c.keyframe_b))
            counts[roots[0], roots[1]] = counts.get((roots[0], roots[1]), 0) + 1
    for pair, count in sorted(counts.items()):
        if known.get(pair) != count:
            known[pair] = count
            chosen, figures = _weighed(site, pair)
            yield pair, figures, 2 * sum(truth.holds(site, c) for c in chosen) <= len(chosen)


def _weighed(site: SiteMap, pair: Pair) -> tuple[list[Constraint], dict[str, float]]:
    chosen, rival = best_sets(site, candidates_between(site, *pair))
    _, trial = solved_together(site, *pair, chosen)
    figures = figures_at_once(site, chosen, rival)
    return chosen, figures | figures_of_maps(site, chosen, trial.poses)
