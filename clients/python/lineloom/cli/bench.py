"""`lineloom bench`: how good the matchers, the mapping and the merging are, measured here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lineloom.cli import options
from lineloom.cli.bench_ladders import ladders
from lineloom.cli.bench_lines import lines
from lineloom.cli.bench_logs import SHARED_LOGS, logs
from lineloom.cli.bench_merges import merges
from lineloom.cli.console import note, out, print_json
from lineloom.cli.failure import CommandError, Exit, needing_core
from lineloom.cli.one_thread import use_one_thread

if TYPE_CHECKING:
    from lineloom_core.matching import MatchResult
    from lineloom_lab.evaluation.pair_bench_contestants import Contestant
    from lineloom_lab.evaluation.pair_bench_sets import BenchSet
    from lineloom_lab.experiments.worst_answers import BadAnswer

SHARED_PAIRS = SHARED_LOGS / "pairs"
"""Where the real pairs lie beside a checkout: `../shared/data/pairs` from the project's root."""

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
app.command("merges")(merges)
app.command("logs")(logs)
app.command("ladders")(ladders)
app.command("lines")(lines)


@app.callback()
def bench() -> None:
    """Measure how good matchers and lines are, what becomes of real logs, how safe merging is.

    \b
    Example:
      lineloom bench logs --quick
      lineloom bench merges --quick
      lineloom bench pairs --limit 10
    """


Matchers = Annotated[
    str,
    typer.Option(
        metavar="NAMES",
        help="Who takes part, with commas: all, baselines, peers, or names from the table.",
    ),
]
PairsFolder = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Real pairs (*.npz); ../shared/data/pairs beside the checkout if left out.",
    ),
]
Simulated = Annotated[
    int,
    typer.Option(
        min=0, max=1000, metavar="N", help="Simulated pairs per lidar and overlap; 0 for none."
    ),
]
FromLogs = Annotated[
    int,
    typer.Option(
        "--from-logs",
        min=0,
        max=1000,
        metavar="N",
        help="Pairs drawn from each log beside the real pairs, of each tier; 0 for none.",
    ),
]
Lidars = Annotated[
    bool,
    typer.Option(
        "--lidars", help="Pairs of logs also with fewer beams, less reach, narrower, noisier …"
    ),
]
Limit = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="At most so many pairs of each tier and overlap."),
]
Worst = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Draw each matcher's ten worst answers per collection into this folder.",
    ),
]


@app.command("pairs")
def pairs(
    matchers: Matchers = "all",
    data: PairsFolder = None,
    simulated: Simulated = 40,
    from_logs: FromLogs = 60,
    lidars: Lidars = False,
    limit: Limit = None,
    worst: Worst = None,
    json: options.Json = False,
) -> None:
    """Run matchers over scan pairs whose true pose is known: how often right, how sure, how fast.

    The default, the thesis's, the literature's, and peers from PyPI (`pip install --group peers`;
    those that are not installed are named as such). Of every log with poses to compare with, pairs
    are drawn, and told for the two halves of the buildings side by side: parameters are chosen with
    half A. Everything takes half an hour; the same options give the same answers, only times
    differ.

    \b
    Example:
      lineloom bench pairs --limit 10
      lineloom bench pairs --matchers lineloom,baselines --simulated 0 --json
      lineloom bench pairs --matchers lineloom --lidars
      lineloom bench pairs --matchers lineloom --worst out/worst
    """
    use_one_thread()
    with needing_core("benchmarks"):
        from lineloom_lab.evaluation.pair_bench import run_pair_bench
        from lineloom_lab.evaluation.pair_bench_report import to_json, to_markdown
    contestants = _contestants(matchers)
    sets = _sets(data, simulated, limit) + _of_logs(
        data, min(from_logs, limit or from_logs), lidars
    )
    if not sets:
        raise CommandError("there are no pairs: name a folder with --data, or use --simulated")
    album = _Album(worst)
    rows = run_pair_bench(contestants, sets, note, album.add)
    album.save()
    if json:
        print_json(to_json(rows, sets))
    else:
        out.print(to_markdown(rows, sets), markup=False, soft_wrap=True)


class _Album:
    """Gathers wrong answers and draws the worst; does nothing without a folder."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._bad: dict[str, list[BadAnswer]] = {}

    def add(self, who: str, pairs: BenchSet, results: Sequence[MatchResult]) -> None:
        """Keep what `who` got wrong in one set."""
        from lineloom_lab.experiments.worst_answers import bad_answers

        if self._folder is not None:
            name = f"{who}-{pairs.collection}".replace(" ", "-")
            self._bad.setdefault(name, []).extend(bad_answers(pairs.name, pairs.pairs, results))

    def save(self) -> None:
        """Write one figure per matcher and collection, PNG and SVG, and say where."""
        from lineloom_lab.experiments.worst_answers import worst_answers

        if self._folder is None:
            return
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            for name, bad in self._bad.items():
                figure = worst_answers(f"worst-{name}", bad)
                if figure is not None:
                    note(f"wrote {figure.save(self._folder)[1]}")
        except OSError as error:
            raise CommandError(f"--worst: {error}") from None


def _contestants(names: str) -> tuple[Contestant, ...]:
    from lineloom_lab.evaluation.pair_bench_contestants import chosen

    try:
        return chosen([name.strip() for name in names.split(",") if name.strip()])
    except ValueError as error:
        raise CommandError(f"--matchers: {error}", Exit.USAGE) from None


def _sets(data: Path | None, simulated: int, limit: int | None) -> tuple[BenchSet, ...]:
    from lineloom_lab.evaluation.pair_bench_sets import real_sets, simulated_sets

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
    return sets


def _of_logs(data: Path | None, per_tier: int, lidars: bool) -> tuple[BenchSet, ...]:
    """Pairs of the logs in the folder above that of the pairs; none where there are no logs."""
    from lineloom_lab.evaluation.pair_bench_lidars import DERIVED, RECORDED
    from lineloom_lab.evaluation.pair_bench_logs import log_sets

    if per_tier == 0:
        return ()
    chosen = (RECORDED, *DERIVED) if lidars else (RECORDED,)
    folder = data.resolve().parent if data is not None else SHARED_LOGS
    try:
        return tuple(log_sets(folder, per_tier, chosen))
    except (OSError, ValueError) as error:
        note(f"no pairs of logs: {error}")
        return ()
