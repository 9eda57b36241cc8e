"""`lineloom map`: the fused line map as a file."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

import typer

from lineloom.calls import Box
from lineloom.cli import options
from lineloom.cli.complete import component_names
from lineloom.cli.deliver import deliver, refuse_terminal
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.patience import quick
from lineloom.cli.word import Word
from lineloom.client import Client
from lineloom.wire import MAP_FORMATS


class Frame(Word):
    """Coordinates."""

    MAP = "map"
    PLAN = "plan"


Format = Enum("Format", [(name, name) for name in MAP_FORMATS], type=str)  # type: ignore[misc]
"""What the service writes."""

_SVG = Format("svg")

FormatOption = Annotated[Format, typer.Option("--format", "-f", help="What kind of file to make.")]
Component = Annotated[
    str | None,
    typer.Option(
        metavar="ID",
        help="Only this component; else all of them.",
        autocompletion=component_names,
    ),
]
BBox = Annotated[
    str | None,
    typer.Option(metavar="X1,Y1,X2,Y2", help="Only what lies in this box of the map [m]."),
]
Align = Annotated[
    bool, typer.Option("--align", help="Turn the map so that its walls run along the axes.")
]
FrameOption = Annotated[
    Frame, typer.Option(help="In which coordinates: the map's own, or the floor plan's.")
]
Resolution = Annotated[
    float | None,
    typer.Option(min=0.001, max=10.0, metavar="METRES", help="Size of a cell of a nav2 map; 0.05."),
]


def map_(
    format: FormatOption = _SVG,
    output: options.Output = None,
    site: options.Site = options.DEFAULT_SITE,
    component: Component = None,
    bbox: BBox = None,
    align: Align = False,
    frame: FrameOption = Frame.MAP,
    resolution: Resolution = None,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Fetch the map of a site.

    --json is --format json. nav2 is a zip of map.pgm and map.yaml, of one component.

    \b
    Example:
      lineloom map --site floor-2 --format svg --output map.svg
      lineloom map --format nav2 --component c0 --output map.zip
    """
    chosen = "json" if json else format.value
    kind = MAP_FORMATS[chosen]
    refuse_terminal(output, binary=kind.binary, example=f"map.{kind.suffix}")
    with Client(url, token=token, retry=quick()) as client:
        content = client.map_file(
            site,
            chosen,
            component=component,
            bbox=read_box(bbox),
            align=align,
            frame=frame.value,
            resolution=resolution,
        )
    deliver(content, output)


def read_box(text: str | None) -> Box | None:
    """Return the box that an option means, or end the command."""
    if text is None:
        return None
    try:
        x1, y1, x2, y2 = (float(part) for part in text.split(","))
    except ValueError:
        raise CommandError(f"--bbox {text}: give four numbers, X1,Y1,X2,Y2", Exit.USAGE) from None
    return (x1, y1, x2, y2)
