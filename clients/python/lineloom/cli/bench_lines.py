"""`lineloom bench lines`: how good the map's lines are, measured here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lineloom.cli.bench_logs import SHARED_LOGS
from lineloom.cli.bench_runs import JsonFile, deliver
from lineloom.cli.console import note
from lineloom.cli.failure import CommandError, Exit, needing_core
from lineloom.cli.one_thread import use_one_thread

if TYPE_CHECKING:
    from lineloom_lab.evaluation.line_bench import LineSource

Quick = Annotated[bool, typer.Option("--quick", help="Three simulated floors: half a minute.")]
OnlyCases = Annotated[
    str | None, typer.Option(metavar="CASE", help="Only cases that have this in their name.")
]
RealLogs = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER", help="Real logs; ../shared/data beside the checkout if left out."
    ),
]


def lines(
    quick: Quick = False,
    only: OnlyCases = None,
    data: RealLogs = None,
    json: JsonFile = None,
) -> None:
    """Map simulated floors and real logs, and judge the lines of the maps.

    Floors: seven lidars from 120 to 1080 beams through offices, flats and corridors, people, fleets
    of three, held against the walls that were seen: precision and recall, lines a face, corners.
    Of real logs, whose walls nobody knows: how much is splinters, twins, and ends that meet.

    \b
    Example:
      lineloom bench lines --quick
      lineloom bench lines --only sick --json out/lines.json
    """
    use_one_thread()
    with needing_core("benchmarks"):
        from lineloom_lab.evaluation.line_bench import run_line_bench
        from lineloom_lab.evaluation.line_bench_report import lines_json, lines_markdown
    cases = _cases(data, quick=quick)
    chosen = [case for case in cases if only is None or only in case.name]
    if not chosen:
        names = "; ".join(case.name for case in cases)
        raise CommandError(f"--only: no case has {only!r} in its name: {names}", Exit.USAGE)
    results = run_line_bench(chosen, on_progress=note)
    deliver(lines_json(results), lines_markdown(results), json)


def _cases(data: Path | None, *, quick: bool) -> Sequence[LineSource]:
    from lineloom_lab.evaluation.line_bench_floors import floors
    from lineloom_lab.evaluation.log_bench_files import log_files

    simulated = floors(quick=quick)
    if quick and data is None:
        return simulated
    try:
        return [*simulated, *log_files(data or SHARED_LOGS)]
    except OSError as error:
        if data is not None:
            raise CommandError(f"{error}: name a folder with --data") from None
        note(f"no real logs: {error}")
        return simulated
