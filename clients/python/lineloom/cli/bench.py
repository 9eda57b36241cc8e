"""`lineloom bench`: how good the matchers are, measured here."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lineloom.cli import options
from lineloom.cli.console import note, out, print_json
from lineloom.cli.failure import CommandError, Exit

if TYPE_CHECKING:
    from lineloom_core.evaluation.pair_bench_contestants import Contestant
    from lineloom_core.evaluation.pair_bench_sets import BenchSet

SHARED_PAIRS = Path(__file__).resolve().parents[5] / "shared" / "data" / "pairs"
"""Where the real pairs lie beside a checkout: `../shared/data/pairs` from the project's root."""

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def bench() -> None:
    """Measure how good the matchers are.

    \b
    Example:
      lineloom bench pairs --limit 10
    """


@app.command("pairs")
def pairs(
    matchers: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="Who takes part, with commas: all, baselines, peers, or names from the table.",
        ),
    ] = "all",
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Real pairs (*.npz); ../shared/data/pairs beside the checkout if left out.",
        ),
    ] = None,
    simulated: Annotated[
        int,
        typer.Option(
            min=0, max=1000, metavar="N", help="Simulated pairs per lidar and overlap; 0 for none."
        ),
    ] = 40,
    limit: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="At most so many pairs of each tier and overlap."),
    ] = None,
    json: options.Json = False,
) -> None:
    """Run matchers over scan pairs whose true pose is known: how often right, how sure, how fast.

    The default, the thesis's, the literature's, and peers from PyPI (`pip install --group peers`;
    those that are not installed are named as such). Everything takes a quarter of an hour; the
    same options give the same answers, only times differ.

    \b
    Example:
      lineloom bench pairs --limit 10
      lineloom bench pairs --matchers lineloom,baselines --simulated 0 --json
    """
    for variable in _ONE_THREAD:
        # Before the core is loaded: threads that wait for work would count as CPU time.
        os.environ.setdefault(variable, "1")
    try:
        from lineloom_core.evaluation.pair_bench import run_pair_bench
        from lineloom_core.evaluation.pair_bench_report import to_json, to_markdown
    except ImportError:
        raise CommandError(
            "benchmarks need the core: `pip install lineloom-client[server]`"
        ) from None
    contestants = _contestants(matchers)
    sets = _sets(data, simulated, limit)
    rows = run_pair_bench(contestants, sets, note)
    if json:
        print_json(to_json(rows, sets))
    else:
        out.print(to_markdown(rows, sets), markup=False, soft_wrap=True)


def _contestants(names: str) -> tuple[Contestant, ...]:
    from lineloom_core.evaluation.pair_bench_contestants import chosen

    try:
        return chosen([name.strip() for name in names.split(",") if name.strip()])
    except ValueError as error:
        raise CommandError(f"--matchers: {error}", Exit.USAGE) from None


def _sets(data: Path | None, simulated: int, limit: int | None) -> tuple[BenchSet, ...]:
    from lineloom_core.evaluation.pair_bench_sets import real_sets, simulated_sets

    folder = data or SHARED_PAIRS
    sets: tuple[BenchSet, ...] = ()
    try:
        sets += real_sets(folder, limit)
    except (FileNotFoundError, ValueError) as error:
        if data is not None:
            raise CommandError(str(error)) from None
        note(f"no real pairs: {error}")
    if simulated:
        sets += simulated_sets(min(simulated, limit or simulated))
    if not sets:
        raise CommandError("there are no pairs: name a folder with --data, or use --simulated")
    return sets
