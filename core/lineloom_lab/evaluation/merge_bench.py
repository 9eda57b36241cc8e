"""One benchmark of merging: how often a fleet's maps are joined wrongly, and how often not at all.

Steps of `run_case`: 1. draw a building and a fleet (`merge_bench_fleets`); 2. say which robot
pairs are due to merge (`merge_bench_overlap`); 3. play all scans through a `SiteMapper`, and after
every merge 4. judge by the truth which robots are joined rightly and which falsely
(`merge_bench_judge`); 5. judge the poses at the end. A case depends on its seed alone: the same
cases give the same figures, however many run at a time.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.site_mapper import SiteMapper

from lineloom_lab.evaluation.merge_bench_buildings import BuildingClass, building_classes
from lineloom_lab.evaluation.merge_bench_cases import MergeCase
from lineloom_lab.evaluation.merge_bench_fleets import BenchFleet, bench_fleet
from lineloom_lab.evaluation.merge_bench_judge import Judge, PoseFigures, RobotPair, Verdict
from lineloom_lab.evaluation.merge_bench_overlap import Overlap, overlap_of
from lineloom_lab.evaluation.merge_bench_pictures import draw_pair
from lineloom_lab.simulation.fleet import PATH_STEP_M


@dataclass(frozen=True, slots=True)
class MissedPair:
    """A pair that was due and is not rightly joined at the end.

    shared_m: the shorter of both ways shared. true_candidates, wrong_candidates: constraints
    between the two by what they say. reasons: what the true ones wait for, with counts.
    """

    pair: RobotPair
    shared_m: float
    true_candidates: int
    wrong_candidates: int
    reasons: dict[str, int]


@dataclass(frozen=True, slots=True)
class CaseResult:
    """What became of one fleet.

    pairs: robot pairs. due: those that must merge; made: of them, rightly joined at the end. false:
    pairs that were joined falsely at any time; standing: those that still are at the end. poses:
    see `PoseFigures`. first_merge_s, first_merge_scans: driving time and scans of the fleet until
    the first right merge, None where there was none. map_s: CPU time of
    simulation and mapping.
    """

    case: MergeCase
    kind: str
    pairs: int
    due: tuple[RobotPair, ...]
    made: tuple[RobotPair, ...]
    missed: tuple[MissedPair, ...]
    joined: int
    false: tuple[RobotPair, ...]
    standing: tuple[RobotPair, ...]
    poses: PoseFigures
    first_merge_s: float | None
    first_merge_scans: int | None
    scans: int
    driven_m: float
    map_s: float
    notes: dict[str, int] = field(default_factory=dict)


def run_merge_bench(
    cases: Sequence[MergeCase],
    *,
    jobs: int = 1,
    pictures: Path | None = None,
    config: MapperConfig | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> tuple[CaseResult, ...]:
    """Run all cases, `jobs` at a time; the answers come in the order of the cases.

    config: of the mapper, to see what another one would do.
    """
    results = []
    for result in _all_results(cases, jobs, pictures, config):
        results.append(result)
        on_progress(_progress(result, len(results), len(cases)))
    return tuple(results)


def run_case(
    case: MergeCase, pictures: Path | None = None, config: MapperConfig | None = None
) -> CaseResult:
    """Run one case (steps 1 to 5); draw its false and missed pairs into the folder given."""
    kind = next(k for k in building_classes(case.floor_plans) if k.name == case.building)
    fleet = bench_fleet(kind, case.robots, case.seed, case.duration_s)
    overlap = overlap_of(fleet)
    played = _play(fleet, config)
    result = _sum_up(case, kind, fleet, overlap, played)
    if pictures is not None:
        _draw(result, fleet, overlap, played.view, pictures)
    return result


@dataclass
class _Played:
    """A fleet's run: its last view, and what was seen on the way there."""

    judge: Judge
    view: SiteView
    verdict: Verdict
    false: set[RobotPair] = field(default_factory=set)
    first_merge: tuple[float, int] | None = None
    scans: int = 0
    cpu_s: float = 0.0


def _play(fleet: BenchFleet, config: MapperConfig | None) -> _Played:
    """Step 3 and 4: map the fleet's scans; after each merge, hold the map against the truth."""
    mapper, judge = SiteMapper(config), Judge(fleet)
    for robot in fleet.robots:
        if robot.declared_mount.inverted:
            mapper.set_mount(robot.name, robot.declared_mount)
    played = _Played(judge, mapper.view(), Verdict(frozenset(), frozenset()))
    begin = time.process_time()
    for sample in fleet.scans():
        judge.note(sample)
        changes = mapper.add(sample.robot, sample.scan)
        played.scans += 1
        if changes.merges:
            verdict = judge.verdict(mapper.view())
            played.false |= verdict.false
            if verdict.right and played.first_merge is None:
                played.first_merge = sample.time_s, played.scans
    played.cpu_s = time.process_time() - begin
    played.view = mapper.view()
    played.verdict = judge.verdict(played.view)
    played.false |= played.verdict.false
    return played


def _sum_up(
    case: MergeCase, kind: BuildingClass, fleet: BenchFleet, overlap: Overlap, played: _Played
) -> CaseResult:
    names = [robot.name for robot in fleet.robots]
    numbered = list(combinations(range(len(names)), 2))
    due = [(i, j) for i, j in numbered if overlap.due[i, j]]
    right = played.verdict.right
    pairs = {(i, j): (min(names[i], names[j]), max(names[i], names[j])) for i, j in numbered}
    first = played.first_merge or (None, None)
    return CaseResult(
        case=case,
        kind=kind.kind,
        pairs=len(numbered),
        due=tuple(pairs[ij] for ij in due),
        made=tuple(pairs[ij] for ij in due if pairs[ij] in right),
        missed=tuple(
            _missed(played, pairs[i, j], float(min(overlap.way_m[i, j], overlap.way_m[j, i])))
            for i, j in due
            if pairs[i, j] not in right
        ),
        joined=len(right | played.verdict.false),
        false=tuple(sorted(played.false)),
        standing=tuple(sorted(played.verdict.false)),
        poses=played.judge.poses(played.view, played.verdict),
        first_merge_s=first[0],
        first_merge_scans=first[1],
        scans=played.scans,
        driven_m=sum(PATH_STEP_M * len(way) for way in fleet.paths()),
        map_s=played.cpu_s,
        notes=_health(played.view),
    )


def _missed(played: _Played, pair: RobotPair, shared_m: float) -> MissedPair:
    """Why a pair may have been missed: what was found between the two."""
    robot_of = {k.id: k.robot for k in played.view.keyframes}
    between = [
        c
        for c in played.view.constraints
        if c.kind != "sequential"
        and sorted((robot_of[c.keyframe_a], robot_of[c.keyframe_b])) == list(pair)
    ]
    true = [c for c in between if played.judge.is_true(played.view, c)]
    reasons = Counter(f"{c.state}: {c.reason}" for c in true)
    return MissedPair(pair, shared_m, len(true), len(between) - len(true), dict(reasons))


def _health(view: SiteView) -> dict[str, int]:
    return dict(Counter(finding for robot in view.robots.values() for finding in robot.health))


def _draw(
    result: CaseResult, fleet: BenchFleet, overlap: Overlap, view: SiteView, folder: Path
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    wanted = {missed.pair: "missed" for missed in result.missed}
    wanted.update(dict.fromkeys(result.false, "false"))
    for pair, what in sorted(wanted.items()):
        file = folder / f"{what}-{result.case.name}-{pair[0]}-{pair[1]}.png"
        file.write_bytes(draw_pair(fleet, overlap, view, pair, f"{what}: {result.case.name}"))


def _all_results(
    cases: Sequence[MergeCase], jobs: int, pictures: Path | None, config: MapperConfig | None
) -> Iterator[CaseResult]:
    if jobs <= 1:
        yield from (run_case(case, pictures, config) for case in cases)
        return
    # A fresh interpreter each: forking a process that has compiled kernels and threads is unsafe.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_one_thread) as pool:
        yield from pool.map(run_case, cases, [pictures] * len(cases), [config] * len(cases))


def _one_thread() -> None:
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")


def _progress(result: CaseResult, done: int, of: int) -> str:
    return (
        f"{done}/{of} {result.case.name}: {result.pairs} pairs, {len(result.false)} false, "
        f"{len(result.made)} of {len(result.due)} due, {result.map_s:.1f} s"
    )
