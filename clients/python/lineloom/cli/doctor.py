"""`lineloom doctor`: what is wrong, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.check_installation import check_installation
from lineloom.cli.check_scans import check_scans
from lineloom.cli.check_server import check_server
from lineloom.cli.checkup import Finding
from lineloom.cli.console import out, print_json
from lineloom.cli.failure import Exit
from lineloom.retry import RetryPolicy
from lineloom.session import Session

_MARKS = {"ok": "ok   ", "note": "note ", "wrong": "WRONG"}


def doctor(
    scans: Annotated[
        list[Path] | None,
        typer.Argument(metavar="FILE…", help="Recordings to look at, of any kind replay takes."),
    ] = None,
    no_server: Annotated[
        bool, typer.Option("--no-server", help="Look at this machine and the files only.")
    ] = False,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Look at this installation, at a server, and at files of scans; say what to do.

    Nothing is changed, here or there. Exit code 4 where something is wrong.

    \b
    Example:
      lineloom doctor
      lineloom doctor run.jsonl --no-server --json
    """
    found: list[Finding] = []
    _look(found, check_installation(), json=json)
    if not no_server:
        session = Session.build(url, token, "json", None, RetryPolicy(attempts=1), 5.0)
        _look(found, check_server(session), json=json)
    for path in scans or []:
        _look(found, check_scans(path), json=json)
    if json:
        print_json([asdict(finding) for finding in found])
    if any(finding.verdict == "wrong" for finding in found):
        raise typer.Exit(int(Exit.NEGATIVE))


def _look(found: list[Finding], checks: Iterable[Finding], *, json: bool) -> None:
    """Take findings as they come, and show each at once: some checks take seconds."""
    for finding in checks:
        found.append(finding)
        if json:
            continue
        text = f"{_MARKS[finding.verdict]} {finding.check}: {finding.found}"
        out.print(text, markup=False, soft_wrap=True)
        if finding.advice:
            out.print(f"      -> {finding.advice}", markup=False, soft_wrap=True)
