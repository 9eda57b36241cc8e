"""`lineloom bench logs`: what becomes of real logs, measured here."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lineloom.cli.bench_runs import Jobs, JsonFile, Pictures, deliver, run
from lineloom.cli.failure import CommandError, Exit, needing_core
from lineloom.cli.one_thread import use_one_thread

if TYPE_CHECKING:
    from lineloom_lab.evaluation.log_bench_cases import Setting
    from lineloom_lab.evaluation.log_bench_files import LogFile

SHARED_LOGS = Path(__file__).resolve().parents[5] / "shared" / "data"
"""Where real logs lie beside a checkout: `../shared/data` from the project's root."""

Quick = Annotated[
    bool, typer.Option("--quick", help="As one robot and cut in three; every scan, true clock.")
]
Names = Annotated[
    list[str] | None,
    typer.Option(
        "--logs", metavar="NAMES", help="Only these logs, with commas; * stands for anything."
    ),
]
Parts = Annotated[
    str | None, typer.Option(metavar="N,...", help="Into how many robots a log is cut.")
]
Strides = Annotated[
    str | None, typer.Option(metavar="N,...", help="Take every N-th scan, so that steps grow.")
]
Clocks = Annotated[
    str | None,
    typer.Option(
        metavar="NAMES",
        help="Stamps: true, constant, stopped, jittered, x0.3, x3, x20, with commas.",
    ),
]
Odometry = Annotated[bool, typer.Option("--odometry", help="Send the odometry that logs bring.")]
Data = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER", help="The logs; ../shared/data beside the checkout if left out."
    ),
]


def logs(
    quick: Quick = False,
    names: Names = None,
    parts: Parts = None,
    strides: Strides = None,
    clocks: Clocks = None,
    odometry: Odometry = False,
    data: Data = None,
    jobs: Jobs = 1,
    pictures: Pictures = None,
    json: JsonFile = None,
) -> None:
    """Map real logs of many buildings and lidars, and judge the maps by independent references.

    Each log as one robot and cut in three, with every first, second, fourth and eighth scan, and
    with clocks that are true, constant, stopped, jittered or run too slow or too fast. Of
    --parts, --strides and --clocks, naming any runs just the combinations. Figures of the two
    halves of the buildings stand side by side: parameters are chosen with one alone.

    \b
    Example:
      lineloom bench logs --quick --json out/logs.json
      lineloom bench logs --logs seattle,flat* --pictures out/worst
      lineloom bench logs --logs freiburg-101 --clocks true,x20 --strides 1,2
    """
    use_one_thread()
    with needing_core("benchmarks"):
        from lineloom_lab.evaluation.log_bench import LogCase
        from lineloom_lab.evaluation.log_bench_cases import with_odometry
        from lineloom_lab.evaluation.log_bench_report import to_json, to_markdown
    settings = _settings(quick, parts, strides, clocks)
    if odometry:
        settings = with_odometry(settings)
    chosen = _chosen(data or SHARED_LOGS, names, odometry)
    # The settings of one log follow each other, so that it is read once.
    cases = [LogCase(log, setting) for log in chosen for setting in settings]
    results = run(cases, jobs, pictures, json)
    deliver(to_json(results), to_markdown(results), json)


def _settings(
    quick: bool, parts: str | None, strides: str | None, clocks: str | None
) -> list[Setting]:
    from lineloom_lab.evaluation.log_bench_cases import (
        combined_settings,
        full_settings,
        quick_settings,
    )

    if parts is None and strides is None and clocks is None:
        return quick_settings() if quick else full_settings()
    try:
        return combined_settings(
            _numbers("--parts", parts), _numbers("--strides", strides), _words([clocks or ""])
        )
    except ValueError as error:
        raise CommandError(f"--parts, --strides, --clocks: {error}", Exit.USAGE) from None


def _chosen(folder: Path, names: list[str] | None, odometry: bool) -> list[LogFile]:
    from lineloom_lab.evaluation.log_bench_files import log_files

    try:
        found = log_files(folder, odometry=odometry)
    except OSError as error:
        raise CommandError(f"{error}: name a folder with --data") from None
    wanted = _words(names or ["*"])
    for pattern in wanted:
        if not any(fnmatch(log.name, pattern) for log in found):
            known = ", ".join(log.name for log in found)
            raise CommandError(f"--logs: no log is named {pattern}; there are {known}", Exit.USAGE)
    return [log for log in found if any(fnmatch(log.name, pattern) for pattern in wanted)]


def _numbers(option: str, text: str | None) -> list[int]:
    words = _words([text or ""])
    try:
        return [int(word) for word in words]
    except ValueError:
        raise CommandError(f"{option}: {text!r} are no whole numbers", Exit.USAGE) from None


def _words(texts: Sequence[str]) -> list[str]:
    return [word.strip() for text in texts for word in text.split(",") if word.strip()]
