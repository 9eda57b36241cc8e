"""Options that several commands share, worded once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lineloom.address import DEFAULT_URL, TOKEN_VARIABLE, URL_VARIABLE
from lineloom.cli.complete import robot_names, site_names

Url = Annotated[
    str | None,
    typer.Option(
        envvar=URL_VARIABLE,
        metavar="URL",
        help=f"Address of the service; {DEFAULT_URL} if nothing is said.",
    ),
]
Token = Annotated[
    str | None,
    typer.Option(envvar=TOKEN_VARIABLE, metavar="TOKEN", help="Bearer token, where one is asked."),
]
Site = Annotated[
    str,
    typer.Option(
        envvar="LINELOOM_SITE",
        metavar="NAME",
        help="The site: one floor of one building.",
        autocompletion=site_names,
    ),
]
Robot = Annotated[
    str, typer.Argument(metavar="ROBOT", help="Which robot.", autocompletion=robot_names)
]
Yes = Annotated[bool, typer.Option("--yes", help="Do it without asking again.")]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on stdout, for scripts.")
]
Timeout = Annotated[
    float,
    typer.Option(
        min=0.0, metavar="SECONDS", help="How long to wait at the end until the map is idle."
    ),
]
Batch = Annotated[
    int, typer.Option(min=1, max=1000, metavar="N", help="Scans in one POST, at most.")
]
Speed = Annotated[
    float | None,
    typer.Option(
        min=0.001,
        metavar="FACTOR",
        help="Play at this multiple of real time; as fast as the service takes it if left out.",
    ),
]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FILE", help="Write here instead of stdout."),
]

DEFAULT_SITE = "default"
DEFAULT_TIMEOUT = 600.0
