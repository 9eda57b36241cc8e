"""`lineloom bench ladders`: how far lidars, drives and crowds may go, measured in simulation."""

from __future__ import annotations

from typing import Annotated

import typer

from lineloom.cli.bench_runs import Jobs, JsonFile, Pictures, deliver, run
from lineloom.cli.failure import CommandError, Exit, needing_core
from lineloom.cli.one_thread import use_one_thread

Quick = Annotated[
    bool, typer.Option("--quick", help="One building a rung, half as long: two minutes or so.")
]
Seeds = Annotated[
    int, typer.Option(min=1, max=100, metavar="N", help="Buildings and drives of each rung.")
]
OnlyLadder = Annotated[
    str | None,
    typer.Option(metavar="LADDER", help="Only ladders that have this in their name."),
]
Odometry = Annotated[bool, typer.Option("--odometry", help="With wheel odometry that drifts.")]

_DURATION_S, _QUICK_S = 90.0, 45.0


def ladders(
    quick: Quick = False,
    seeds: Seeds = 3,
    only: OnlyLadder = None,
    odometry: Odometry = False,
    jobs: Jobs = 1,
    pictures: Pictures = None,
    json: JsonFile = None,
) -> None:
    """Map simulated logs, with one property varied at a time, and judge the maps by the truth.

    Beams from 45 to 1080, views of 57 to 360 degrees, 4 to 80 m of reach, noise of 5 to 50 mm, 1 to
    40 scans a second, turns of up to 3 rad/s while the beam sweeps (told by the scans, or not), and
    up to eight people about, or four who follow the robot; in offices, flats and corridors.

    \b
    Example:
      lineloom bench ladders --quick
      lineloom bench ladders --only beams --seeds 6 --json out/beams.json
    """
    use_one_thread()
    with needing_core("benchmarks"):
        from lineloom_lab.evaluation.log_bench import LogCase
        from lineloom_lab.evaluation.log_bench_cases import Setting
        from lineloom_lab.evaluation.log_bench_ladder_report import ladders_json, ladders_markdown
        from lineloom_lab.evaluation.log_bench_ladders import SimulatedLog, ladder_rungs
    rungs = ladder_rungs()
    chosen = [rung for rung in rungs if only is None or only in rung.ladder]
    if not chosen:
        names = ", ".join(dict.fromkeys(rung.ladder for rung in rungs))
        raise CommandError(f"--only: no ladder has {only!r} in its name: {names}", Exit.USAGE)
    duration, count = (_QUICK_S, 1) if quick else (_DURATION_S, seeds)
    logs = [SimulatedLog(rung, seed, duration) for rung in chosen for seed in range(count)]
    results = run([LogCase(log, Setting(odometry=odometry)) for log in logs], jobs, pictures, json)
    told = [(log.rung, result) for log, result in zip(logs, results, strict=True)]
    deliver(ladders_json(told), ladders_markdown(told), json)
