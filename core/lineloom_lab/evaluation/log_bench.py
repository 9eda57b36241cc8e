"""One benchmark of mapping: every log through the mapper, with other strides, clocks and robots.

Steps of `run_case`: 1. read the log; 2. turn it into the robots of the setting (`robots_of`);
3. play their scans through a `SiteMapper`, as a service hosts it; 4. judge the map by the reference
(`log_bench_judge`, `log_bench_steps`); 5. draw the worst steps, where that is asked for. A case
gives the same figures every time, but for CPU time.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.site_mapper import SiteMapper
from lineloom_core.scan import Mount, Scan
from lineloom_core.warm_up.drive import drive

from lineloom_lab.evaluation.log_bench_cases import Setting
from lineloom_lab.evaluation.log_bench_clocks import TRUE_CLOCK, with_clock
from lineloom_lab.evaluation.log_bench_judge import LogFigures, PlacedRobot, judge
from lineloom_lab.evaluation.log_bench_log import BenchLog, Half, LogSource, Recording, Trust
from lineloom_lab.evaluation.log_bench_rigid import rigid_figures
from lineloom_lab.evaluation.log_bench_sameness import same_share
from lineloom_lab.evaluation.log_bench_steps import StepFigures, step_figures
from lineloom_lab.evaluation.log_bench_wheels import wheels_rmse

_TURN_SCANS = 50
_LOGS_KEPT = 2

Witness = Callable[["LogCase", Sequence[Recording], Sequence[PlacedRobot]], None]
"""Sees what was played and what came of it, to draw it."""


@dataclass(frozen=True, slots=True)
class LogCase:
    """One log under one setting."""

    source: LogSource
    setting: Setting


@dataclass(frozen=True, slots=True)
class LogResult:
    """What became of a log.

    cpu_ms: mapping, per scan. share_same: of what the same run under the true clock placed, what
    lies likewise here; None without such a run. share_rigid: of two lidars on one robot, where both
    are in one component, what lies as they are mounted; None elsewhere. wheels_rmse: error of the
    odometry alone [m], where it was sent. unreadable: why there is nothing else.
    """

    log: str
    half: Half
    setting: Setting
    trust: Trust
    figures: LogFigures | None
    steps: StepFigures | None
    cpu_ms: float
    share_same: float | None = None
    share_rigid: float | None = None
    wheels_rmse: float | None = None
    unreadable: str | None = None
    placed: tuple[PlacedRobot, ...] = field(default=(), compare=False, repr=False)


def run_log_bench(
    cases: Sequence[LogCase],
    *,
    jobs: int = 1,
    config: MapperConfig | None = None,
    witness: Witness | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> tuple[LogResult, ...]:
    """Run all cases, `jobs` at a time; the answers come in the order of the cases.

    config: of the mapper, to see what another one would do.
    """
    results = []
    for result in _all_results(cases, jobs, config, witness):
        results.append(result)
        on_progress(_progress(result, len(results), len(cases)))
    return _with_sameness(results)


def run_case(
    case: LogCase, config: MapperConfig | None = None, witness: Witness | None = None
) -> LogResult:
    """Run one case (steps 1 to 5). A log that cannot be read is a result too."""
    try:
        log = _loaded(case.source)
    except (ValueError, OSError) as error:
        return LogResult(
            *(case.source.name, case.source.half, case.setting, "none", None, None, 0.0),
            unreadable=str(error),
        )
    robots = robots_of(log, case.setting)
    view, cpu_s = play(robots, config)
    placed = [_placed(robot, view) for robot in robots]
    if witness is not None:
        witness(case, robots, placed)
    rigid = None
    if log.rigid is not None and case.setting.clock == TRUE_CLOCK:
        rigid = rigid_figures(robots, placed, log.rigid).share_agreeing
    return LogResult(
        case.source.name,
        case.source.half,
        case.setting,
        log.trust,
        judge(placed),
        step_figures(placed),
        1e3 * cpu_s / sum(len(robot.scans) for robot in robots),
        share_rigid=rigid,
        wheels_rmse=wheels_rmse(robots),
        placed=tuple(placed),
    )


def robots_of(log: BenchLog, setting: Setting) -> list[Recording]:
    """Return the robots that a setting makes of a log, each with scans numbered from 0."""
    robots = []
    for recording in log.recordings:
        taken = np.arange(0, len(recording.scans), setting.stride)
        for number, part in enumerate(np.array_split(taken, setting.parts)):
            if not len(part):
                continue
            scans = with_clock([recording.scans[i] for i in part.tolist()], setting.clock)
            name = recording.robot if setting.parts == 1 else f"{recording.robot}-{number}"
            robots.append(
                Recording(
                    name,
                    tuple(_numbered(scans, odometry=setting.odometry)),
                    recording.reference[part],
                    recording.inverted,
                )
            )
    return robots


def play(robots: Sequence[Recording], config: MapperConfig | None) -> tuple[SiteView, float]:
    """Map all robots, who take turns as if driving at once; return the map and its CPU time [s]."""
    _warm()
    mapper = SiteMapper(config)
    for robot in robots:
        if robot.inverted:
            mapper.set_mount(robot.robot, Mount(inverted=True))
    begin = time.process_time()
    for name, scan in _in_turns(robots):
        mapper.add(name, scan)
    return mapper.view(), time.process_time() - begin


def _with_sameness(results: Sequence[LogResult]) -> tuple[LogResult, ...]:
    """Hold each run under another clock against the one under the true clock."""
    true = {(r.log, r.setting): r.placed for r in results if r.setting.clock == TRUE_CLOCK}

    def compared(result: LogResult) -> LogResult:
        twin = true.get((result.log, replace(result.setting, clock=TRUE_CLOCK)))
        if not twin or not result.placed or result.setting.clock == TRUE_CLOCK:
            return result
        return replace(result, share_same=same_share(twin, result.placed))

    return tuple(compared(result) for result in results)


def _numbered(scans: Sequence[Scan], *, odometry: bool) -> Iterator[Scan]:
    for seq, scan in enumerate(scans):
        wheels = scan.odometry if odometry else None
        yield replace(scan, seq=seq, session="0", odometry=wheels)


def _in_turns(robots: Sequence[Recording]) -> Iterator[tuple[str, Scan]]:
    longest = max((len(robot.scans) for robot in robots), default=0)
    for begin in range(0, longest, _TURN_SCANS):
        for robot in robots:
            for scan in robot.scans[begin : begin + _TURN_SCANS]:
                yield robot.robot, scan


def _placed(robot: Recording, view: SiteView) -> PlacedRobot:
    """Return where the map has a robot's scans; those that it says nothing of are unplaced."""
    count = len(robot.scans)
    poses, component = np.full((count, 3), np.nan), np.full(count, "", dtype=object)
    way = view.trajectories.get(robot.robot)
    if way is not None:
        poses[way.seq] = way.poses
        component[way.seq] = np.array(way.component, dtype=object)
    return PlacedRobot(robot.robot, poses, component.astype(np.str_), robot.reference)


@lru_cache(_LOGS_KEPT)
def _loaded(source: LogSource) -> BenchLog:
    """A log is run under several settings one after the other: reading it once is enough."""
    return source.load()


@lru_cache(1)
def _warm() -> None:
    """Load all kernels before the first clock is read."""
    drive()


def _all_results(
    cases: Sequence[LogCase], jobs: int, config: MapperConfig | None, witness: Witness | None
) -> Iterator[LogResult]:
    if jobs <= 1:
        yield from (run_case(case, config, witness) for case in cases)
        return
    # A fresh interpreter each: forking a process that has compiled kernels and threads is unsafe.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_one_thread) as pool:
        rows = len(cases)
        yield from pool.map(run_case, cases, [config] * rows, [witness] * rows)


def _one_thread() -> None:
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")


def _progress(result: LogResult, done: int, of: int) -> str:
    told = f"{done}/{of} {result.log}, {result.setting.name}: "
    if result.figures is None:
        return told + f"unreadable: {result.unreadable}"
    largest = 100.0 * result.figures.share_in_largest
    return told + (
        f"{result.figures.components} components, {largest:.0f} % in the largest, "
        f"{result.cpu_ms:.1f} ms a scan"
    )
