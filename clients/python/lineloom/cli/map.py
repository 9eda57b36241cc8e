"""`lineloom map`: the fused line map as a file."""

from __future__ import annotations

import sys
from enum import StrEnum
from typing import Annotated

import typer

from lineloom.calls import Box
from lineloom.cli import options
from lineloom.cli.console import note
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.patience import quick
from lineloom.client import Client


class Format(StrEnum):
    """What the service draws."""

    JSON = "json"
    GEOJSON = "geojson"
    SVG = "svg"
    PNG = "png"


def map_(
    format: Annotated[
        Format, typer.Option("--format", "-f", help="What kind of file to make.")
    ] = Format.SVG,
    output: options.Output = None,
    site: options.Site = options.DEFAULT_SITE,
    component: Annotated[
        str | None, typer.Option(metavar="ID", help="Only this component; else all of them.")
    ] = None,
    bbox: Annotated[
        str | None,
        typer.Option(metavar="X1,Y1,X2,Y2", help="Only what lies in this box of the map [m]."),
    ] = None,
    url: options.Url = None,
    token: options.Token = None,
) -> None:
    """Fetch the map of a site.

    \b
    Example:
      lineloom map --site floor-2 --format svg --output map.svg
    """
    box = _box(bbox)
    if output is None and format is Format.PNG and sys.stdout.isatty():
        raise CommandError("a png is not for the terminal: add --output map.png", Exit.USAGE)
    with Client(url, token=token, retry=quick()) as client:
        content = client.map_file(site, format.value, component=component, bbox=box)
    if output is None:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
        return
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_bytes(content)
    note(f"{output}: {len(content)} bytes")


def _box(text: str | None) -> Box | None:
    if text is None:
        return None
    try:
        x1, y1, x2, y2 = (float(part) for part in text.split(","))
    except ValueError:
        raise CommandError(f"--bbox {text}: give four numbers, X1,Y1,X2,Y2", Exit.USAGE) from None
    return (x1, y1, x2, y2)
