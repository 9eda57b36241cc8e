"""`lineloom bench merges`: how safe the merging is, measured here."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.console import note, out, print_json
from lineloom.cli.failure import CommandError, Exit, needing_core
from lineloom.cli.one_thread import use_one_thread

SHARED_PLANS = Path(__file__).resolve().parents[5] / "shared" / "data" / "floorplans"
"""Where real floor plans lie beside a checkout: `../shared/data` from the project's root."""


Quick = Annotated[bool, typer.Option("--quick", help="Small fleets only: about a minute.")]
Rounds = Annotated[
    int,
    typer.Option(min=1, max=100, metavar="N", help="Buildings per class and size of fleet."),
]
Seed = Annotated[
    int, typer.Option(min=0, metavar="N", help="Seed of buildings, fleets and faults.")
]
Jobs = Annotated[
    int, typer.Option(min=1, max=64, metavar="N", help="Fleets at a time, a process each.")
]
OnlyClass = Annotated[
    str | None,
    typer.Option(metavar="CLASS", help="Only buildings whose class has this in its name."),
]
FloorPlans = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Real floor plans (*.txt); ../shared/data beside the checkout if left out.",
    ),
]
Pictures = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Draw every false and every missed merge into DIR."),
]


def merges(
    quick: Quick = False,
    rounds: Rounds = 2,
    seed: Seed = 0,
    jobs: Jobs = 1,
    only: OnlyClass = None,
    floor_plans: FloorPlans = None,
    pictures: Pictures = None,
    json: options.Json = False,
) -> None:
    """Run fleets of 2 to 8 robots through buildings and count false and missed merges.

    Buildings of equal rooms, hotel floors, floors of the same walls, self-similar corridors,
    symmetric halls and ordinary ones; with people, closed doors, glass, lost scans, clocks that
    disagree, and lidars mounted upside down. The same options give the same figures, however many
    jobs; everything takes about a quarter of an hour with two.

    \b
    Example:
      lineloom bench merges --quick
      lineloom bench merges --jobs 2 --pictures out/merges --json
    """
    use_one_thread()
    with needing_core("benchmarks"):
        from lineloom_lab.evaluation.merge_bench import run_merge_bench
        from lineloom_lab.evaluation.merge_bench_cases import full_cases, quick_cases
        from lineloom_lab.evaluation.merge_bench_report import to_json, to_markdown
    plans = _plans(floor_plans)
    cases = quick_cases(seed, plans) if quick else full_cases(seed, rounds, plans)
    chosen = [case for case in cases if only is None or only in case.building]
    if not chosen:
        names = ", ".join(dict.fromkeys(case.building for case in cases))
        raise CommandError(f"--only: no class has {only!r} in its name: {names}", Exit.USAGE)
    results = run_merge_bench(chosen, jobs=jobs, pictures=pictures, on_progress=note)
    if json:
        print_json(to_json(results))
    else:
        out.print(to_markdown(results), markup=False, soft_wrap=True)


def _plans(folder: Path | None) -> Path | None:
    if folder is not None and not any(folder.glob("*.txt")):
        raise CommandError(f"no floor plans (*.txt) in {folder}")
    if folder is None and not SHARED_PLANS.is_dir():
        note(f"no real floor plans: {SHARED_PLANS} is missing")
        return None
    return folder or SHARED_PLANS
