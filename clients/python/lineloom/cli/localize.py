"""`lineloom localize`: where scans were taken in a site's map."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.console import out, print_json
from lineloom.cli.failure import Exit
from lineloom.cli.patience import quick
from lineloom.cli.scan_files import read_one
from lineloom.client import Client
from lineloom.wire import LocalizeAnswer


def localize(
    scans: Annotated[
        list[str],
        typer.Argument(
            metavar="SCAN…", help="FILE or FILE:LINE; several are a run of one robot, in order."
        ),
    ],
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Find where the last of the scans was taken in a site's map; adds nothing to the map.

    Exit code 4 where the place is not unique.

    \b
    Example:
      lineloom localize rooms.jsonl:40 --site rooms
      lineloom localize rooms.jsonl:38 rooms.jsonl:39 rooms.jsonl:40 --site rooms --json
    """
    run = [read_one(reference).scan for reference in scans]
    with Client(url, token=token, retry=quick()) as client:
        answer = client.localize(site, run)
    if json:
        print_json(answer.model_dump(mode="json"))
    else:
        _show(answer)
    if answer.verdict != "unique":
        raise typer.Exit(int(Exit.NEGATIVE))


def _show(answer: LocalizeAnswer) -> None:
    out.print(f"{answer.verdict}: {answer.reason}", markup=False)
    for place in answer.hypotheses:
        out.print(
            f"{place.component}: x {place.x:.3f} m, y {place.y:.3f} m, "
            f"theta {math.degrees(place.theta):.2f} deg (score {place.score:.2f})",
            markup=False,
        )
