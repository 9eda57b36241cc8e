"""`lineloom experiment`: the thesis's chapter 6 again, with its figures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lineloom.cli import options
from lineloom.cli.console import note, out, print_json
from lineloom.cli.failure import CommandError, Exit, needing_core
from lineloom.cli.served_experiment import Service
from lineloom.cli.word import Word

if TYPE_CHECKING:
    from lineloom_lab.experiments import Experiment, Report, Settings

SHARED_DATA = Path(__file__).resolve().parents[5] / "shared" / "data"
"""Where real data lies beside a checkout: `../shared/data` from the project's root."""


class MatcherChoice(Word):
    """Who takes part."""

    DEFAULT = "default"
    THESIS = "thesis"
    BOTH = "both"


ExperimentName = Annotated[
    str | None,
    typer.Argument(metavar="NAME", help="Which experiment, from --list; all for all of them."),
]
Listing = Annotated[bool, typer.Option("--list", help="Say which experiments there are, and stop.")]
Output = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="DIR",
        help="Write report (md, json) and figures (svg, png) into this folder.",
    ),
]
Seed = Annotated[
    int, typer.Option(min=0, metavar="N", help="Seed of the sensor's noise and of samples.")
]
Quick = Annotated[
    bool, typer.Option("--quick", help="A reduced run of a few seconds, to see that it works.")
]
Matcher = Annotated[
    MatcherChoice, typer.Option(help="Who takes part: one of the matchers, or both.")
]
Data = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Real data for real-scans; ../shared/data beside the checkout if left out.",
    ),
]

Url = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="Run closed-path or sparse-path through the service at this address.",
    ),
]
Scans = Annotated[
    int | None,
    typer.Option(min=2, max=20_000, metavar="N", help="With --url: so many scans along the path."),
]


def experiment(
    name: ExperimentName = None,
    listing: Listing = False,
    output: Output = None,
    seed: Seed = 0,
    quick: Quick = False,
    matcher: Matcher = MatcherChoice.BOTH,
    data: Data = None,
    url: Url = None,
    token: options.Token = None,
    scans: Scans = None,
    timeout: options.Timeout = options.DEFAULT_TIMEOUT,
    json: options.Json = False,
) -> None:
    """Run an experiment of the thesis's chapter 6 again, and draw its figures.

    The thesis's matcher and the default one side by side, on simulated scans of the sizes that
    the text gives; the report says what differs from the printed figures, and why. The longest
    run takes under a minute.

    With --url the path is posted to a running service instead, once for each value of the mapper's
    parameter `matcher`, to new sites, and what their trajectories and maps have come to is shown.

    \b
    Example:
      lineloom experiment --list
      lineloom experiment sparse-path --output out/sparse
      lineloom experiment sparse-path --url http://localhost:8765 --scans 90
      lineloom experiment all --quick --seed 3 --matcher thesis --json
    """
    if listing:
        _list()
        return
    settings = _settings(seed, quick, matcher, data)
    service = None if url is None else Service(url, token, timeout, scans)
    if service is None and scans is not None:
        raise CommandError("--scans goes with --url", Exit.USAGE)
    reports = []
    for chosen in _chosen(name):
        report = _report(chosen, settings, name == "all", service)
        if report is not None:
            reports.append(report)
            if output is not None:
                _save(report, output)
    if json:
        documents = [report.to_json() for report in reports]
        print_json(documents if name == "all" else documents[0])
    else:
        out.print("\n".join(r.to_markdown() for r in reports), markup=False, soft_wrap=True)


def _settings(seed: int, quick: bool, matcher: MatcherChoice, data: Path | None) -> Settings:
    with needing_core("experiments"):
        from lineloom_lab.experiments import Settings
    return Settings(seed=seed, quick=quick, matcher=matcher.value, data=data or SHARED_DATA)


def _list() -> None:
    _settings(0, True, MatcherChoice.BOTH, None)  # says what to install where the core is absent
    from lineloom_lab.experiments import EXPERIMENTS

    width = max(len(e.name) for e in EXPERIMENTS)
    out.print("\n".join(f"{e.name.ljust(width)}  {e.about}" for e in EXPERIMENTS), markup=False)


def _chosen(name: str | None) -> tuple[Experiment, ...]:
    from lineloom_lab.experiments import EXPERIMENTS, UnknownExperimentError, experiment_named

    if name is None:
        raise CommandError("which experiment? `lineloom experiment --list` says", Exit.USAGE)
    if name == "all":
        return EXPERIMENTS
    try:
        return (experiment_named(name),)
    except UnknownExperimentError as error:
        raise CommandError(str(error), Exit.USAGE) from None


def _report(
    chosen: Experiment, settings: Settings, one_of_many: bool, service: Service | None
) -> Report | None:
    """Run one experiment; where its data is missing, all others still run."""
    from lineloom_lab.experiments import MissingDataError

    if service is not None:
        return service.run(chosen.name, settings)
    note(f"{chosen.name}: {chosen.about} …")
    try:
        return chosen.run(settings)
    except MissingDataError as error:
        if not one_of_many:
            raise CommandError(f"{error}. Name a folder with --data.") from None
        note(f"skipped: {error}")
        return None


def _save(report: Report, folder: Path) -> None:
    for path in report.save(folder):
        note(f"wrote {path}")
