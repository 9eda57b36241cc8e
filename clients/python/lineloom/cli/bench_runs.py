"""What `bench logs` and `bench ladders` do alike: run, print, write and draw."""

from __future__ import annotations

import json as json_format
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lineloom.cli.console import note, out, print_json
from lineloom.cli.failure import CommandError

if TYPE_CHECKING:
    from lineloom_lab.evaluation.log_bench import LogCase, LogResult

Jobs = Annotated[
    int, typer.Option(min=1, max=64, metavar="N", help="Runs at a time, a process each.")
]
Pictures = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Draw the ten worst steps and breaks of every run into DIR."),
]
JsonFile = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="FILE", help="Also write all figures here as JSON; - for stdout alone."
    ),
]


def run(
    cases: Sequence[LogCase], jobs: int, pictures: Path | None, json: Path | None
) -> tuple[LogResult, ...]:
    """Run the cases; before that, find out whether what they give can be written."""
    from lineloom_lab.evaluation.log_bench import run_log_bench
    from lineloom_lab.experiments.worst_steps import StepAlbum

    for option, folder in (("--pictures", pictures), ("--json", _folder(json))):
        _make(option, folder)
    album = None if pictures is None else StepAlbum(pictures)
    return run_log_bench(cases, jobs=jobs, witness=album, on_progress=note)


def deliver(document: dict[str, Any], table: str, json: Path | None) -> None:
    """Print the table and write the document beside it; for `--json -`, print that alone."""
    if json is not None and _folder(json) is None:
        print_json(document)
        return
    if json is not None:
        try:
            json.write_text(json_format.dumps(document, indent=2), encoding="utf-8")
        except OSError as error:
            note(f"--json: {error}")
    out.print(table, markup=False, soft_wrap=True)


def _folder(json: Path | None) -> Path | None:
    """Return where a file is to be written; None for stdout."""
    return None if json is None or json == Path("-") else json.parent


def _make(option: str, folder: Path | None) -> None:
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(f"{option}: {error}") from None
