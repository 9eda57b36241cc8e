"""`lineloom graph`: the pose graph."""

from __future__ import annotations

from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.deliver import deliver
from lineloom.cli.map import Align, Frame, FrameOption
from lineloom.cli.patience import quick
from lineloom.cli.word import Word
from lineloom.client import Client


class Format(Word):
    """What the service writes."""

    JSON = "json"
    G2O = "g2o"


def graph(
    format: Annotated[
        Format, typer.Option("--format", "-f", help="What kind of file to make.")
    ] = Format.G2O,
    output: options.Output = None,
    site: options.Site = options.DEFAULT_SITE,
    align: Align = False,
    frame: FrameOption = Frame.MAP,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Fetch the pose graph: keyframes, and constraints with their information.

    g2o is what gtsam and others read; --json is --format json (networkx's node-link).

    \b
    Example:
      lineloom graph --site floor-2 --format g2o --output floor-2.g2o
    """
    with Client(url, token=token, retry=quick()) as client:
        if json or format is Format.JSON:
            found = client.graph(site, align=align, frame=frame.value)
            text = found.model_dump_json()
        else:
            text = client.graph_g2o(site, align=align, frame=frame.value)
    deliver(text.encode(), output)
